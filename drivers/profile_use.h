// SPDX-License-Identifier: MIT
// What an exchange or write of a profile does to the world, for whoever runs them by name at a
// bench: which only ask, which set one value, which switch light on. Pure. Thread: any.
#pragma once
#include "drivers/profile_data.h"

// Of a message instrument: whether an exchange only asks. It answers with values, sends none, and
// no role sends it to get something done.
bool profile_only_asks(const struct profile *p, int exchange);
// Of a Modbus instrument: whether a value can be read.
bool profile_is_readable(const struct profile *p, int value);
// The exchange or write that sets this value, of those the one that needs fewest others; -1: none.
// Nothing that moves an axis or changes a selector's position is one.
int profile_setter(const struct profile *p, int value);
// Whether an exchange or write switches emission on or keeps it on: it is the laser's ON or
// keepalive or sends the same, or with these values and what it changes "emitting" holds. d: what
// is sent; NULL: nothing is known.
bool profile_switches_on(const struct profile *p, const char *does, const struct profile_data *d);
