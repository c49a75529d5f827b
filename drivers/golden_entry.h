// SPDX-License-Identifier: MIT
// What went over a wire as an entry of a profile's "golden": which exchange or write it was, with
// which values, and what its answer gives. An entry is only made when it passes
// profile_golden_check, so that whoever pastes it into the profile finds it right. Takes some ms;
// thread: any.
#pragma once
#include "drivers/capture.h"
#include "drivers/profile_data.h"

enum golden_wire { GOLDEN_MESSAGE, GOLDEN_RTU, GOLDEN_TCP };

struct golden_maker {
    const struct profile *p;
    enum golden_wire wire; // RTU frames are made of those of TCP: without header, with CRC
    int unit;
    const char *source; // of the entries; at most PROFILE_TEXT - 1 are kept
    bool is_usb;        // the transfer ends an answer; elsewhere only its terminator does
};

// does: the exchange or write that it probably was; others are tried, too. with: what that was told
// ("speed = 3"), "" for what has no values; d: what was known then. GON_E_LINK: the answer is
// missing, or one that cannot be read; GON_E_INPUT: it is none of the profile's.
int golden_entry_make(const struct golden_maker *m, const struct captured *c, const char *does,
                      const char *with, const struct profile_data *d,
                      struct profile_golden *ret_golden, struct gon_error *err);
