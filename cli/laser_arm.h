// SPDX-License-Identifier: MIT
// gonio laser, arm and disarm: what asks goniod.
#pragma once
#include "cli/remote.h"

// what NULL: show. Returns the exit status.
int laser_ask(const struct remote_options *remote, const char *what, const char *time,
              const char *reason, double power_w);
// "8h", "90min", "30s", in seconds; GON_E_INPUT. A bare number is none: of what?
int laser_time(const char *text, double *ret_s);
