// SPDX-License-Identifier: MIT
// A live instrument, asked and told by name, with every exchange kept as a golden entry of its
// profile. The production session talks; a tap on its link (drivers/tap.h) sees the bytes;
// golden_entry makes entries of them. What makes no entry is given as a comment with its bytes, so
// nothing is lost. An exchange that was kept already with the same bytes is not given again.
//
// Nothing here switches light on: ON, keepalive and what amounts to them are refused. Thread: one.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "drivers/profile.h"

struct recorder;

// golden: an entry; NULL: only a comment. comment: one line, "" for none; what it says of an entry
// stands before it. Borrowed until it returns.
struct recorder_sink {
    void (*take)(void *ctx, const struct profile_golden *golden, const char *comment);
    void *ctx;
};

// Opens the link and sends nothing. unit: Modbus address, 1..247. The profile is borrowed.
int recorder_open(const struct profile *p, const char *link, int unit, struct clk *clk,
                  const struct cancel *cancel, struct recorder_sink sink,
                  struct recorder **ret_recorder, struct gon_error *err);
void recorder_close(struct recorder *r);

// A line says what to do:
//   NAME, NAME             exchanges of a message instrument, values of a Modbus one: they are
//   asked VALUE = NUMBER         what sets that value is sent with it, then what reads it back NAME
//   an exchange or write that does something NAME: A = 1, B = 2     the same with its values and
//   $NAMEs
// 0; GON_E_INPUT: no such thing, or a value that cannot be; GON_E_REFUSED: it would switch light
// on. Sends nothing.
int recorder_may(const struct profile *p, const char *line, struct gon_error *err);
// Does it, gives what came to the sink. Errors of recorder_may; GON_E_LINK, GON_E_GONE,
// GON_E_DEVICE, GON_E_CANCELED, and GON_E_REFUSED of the instrument: they are in a comment, too.
int recorder_do(struct recorder *r, const char *line, struct gon_error *err);
// Who it is; the sources of all entries say so from then on.
int recorder_identify(struct recorder *r, char *ret_title, size_t size, struct gon_error *err);
// Everything that can be asked and was not yet. Goes on after a failure, but not when the
// instrument is gone. How many failed; GON_E_GONE, GON_E_CANCELED.
int recorder_ask_all(struct recorder *r, struct gon_error *err);
