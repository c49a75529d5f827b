// SPDX-License-Identifier: MIT
// A profile against the bytes that a source or recording shows (struct profile_golden), through
// the code that talks to instruments: session, message, and for Modbus bus and libmodbus RTU, over
// a pseudo-terminal. What is sent must be the bytes shown, one by one; what is answered must be
// read as the entry says. Waits, gaps and read-backs are left out: they are not what is shown.
//
// Message: sent and received without terminators, echo and OK line, but with their checksum. An
// entry whose answer refuses passes when it is understood as a refusal and gives nothing. Modbus:
// whole RTU frames; "with" names values or the write's $NAMEs; of an edge, the frame that sets it.
// Takes some ms an entry. Thread: any; it starts one.
#pragma once
#include "drivers/profile_data.h"

// "with" of a write: each name is a $NAME, a value, or both.
struct golden_params {
    char name[16][PROFILE_NAME];
    struct profile_param param[17]; // of the write; ends with NULL
};
int profile_golden_with(const struct profile *p, const char *text, struct profile_data *d,
                        struct golden_params *ret_params, struct gon_error *err);
// Whether this answer to an exchange is one that refuses.
bool profile_golden_refuses(const struct profile *p, const char *does, const char *answer);

// Of golden[entry]. GON_E_INPUT: a mismatch, "got ... / expected ... / at byte n"; GON_E_SYSTEM.
int profile_golden_check(const struct profile *p, int entry, struct gon_error *err);
