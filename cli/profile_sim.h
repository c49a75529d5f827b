// SPDX-License-Identifier: MIT
// `gonio profile sim`: an instrument made from its profile, to try scripts and drivers with.
#pragma once

// argv[0] is "sim". Becomes goniosim, which says how to reach the instrument and ends with Ctrl-C;
// returns (an exit_status) only when that did not succeed.
int profile_sim(int argc, char **argv);
