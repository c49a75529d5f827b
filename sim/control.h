// SPDX-License-Identifier: MIT
// What the control socket (sim/request.h) can do to the bench. Everything that is done to it from
// outside its wires goes through here. Besides what concerns wires:
//
//   {"do":"state"}   {"do":"truth"}
//   {"do":"power-cycle","axis":A}
//   {"do":"set", ...} with any of
//     "interlock":"open"|"closed"   "key":"on"|"off"   "ignore_off":bool   "saturate":bool
//     "axis":A and "alarm":CODE     "term":T and "on":bool (of the optics)
//
// W: axes, axes-tcp, laser, laser-tcp, detector, detector-tcp. A: theta_i, theta_r, sample. Times
// are monotonic nanoseconds, as clk_now_ns gives them on this machine. Thread: the poll loop's.
#pragma once
#include "sim/bench.h"
#include "sim/wire.h"

// The answer to one line, with its newline, to be freed; NULL without memory. wires: BENCH_PORTS of
// them.
char *control_answer(struct bench *bench, struct wire *wires, const char *line, int64_t t_ns);
