// SPDX-License-Identifier: MIT
// The control socket's language: one JSON object a line in, one out ({"ok":true,...} or
// {"ok":false, "error":"..."}). Everything that is done to the bench from outside its wires goes
// through here.
//
//   {"do":"state"}   {"do":"truth"}
//   {"do":"unplug","wire":W}  {"do":"plug","wire":W}  {"do":"mute","wire":W}
//   {"do":"unmute","wire":W}
//   {"do":"power-cycle","axis":A}
//   {"do":"set", ...} with any of
//     "interlock":"open"|"closed"   "key":"on"|"off"   "ignore_off":bool   "saturate":bool
//     "wire":W and "drop":N (next replies lost), "delay_ms":MS (of the next reply)
//     "axis":A and "alarm":CODE     "term":T and "on":bool (of the optics)
//
// W: axes, axes-tcp, laser, laser-tcp, detector, detector-tcp. A: theta_i, theta_r, sample. Times
// are monotonic nanoseconds, as clk_now_ns gives them on this machine. Thread: the poll loop's.
#pragma once
#include "sim/bench.h"
#include "sim/wire.h"

struct control {
    struct bench *bench;
    struct wire *wires; // BENCH_PORTS of them
};

// The answer to one line, with its newline, to be freed; NULL without memory.
char *control_answer(const struct control *c, const char *line, int64_t t_ns);
