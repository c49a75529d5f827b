// SPDX-License-Identifier: MIT
// `gonio profile record`: a session with a real instrument as golden entries of its profile.
#pragma once

// argv[0] is "record". Returns an exit_status.
int profile_record(int argc, char **argv);
