// SPDX-License-Identifier: MIT
// The simulated bench on its wires: ptys axes, laser and detector, the same on TCP, and the bench
// files goniod.cfg and goniod-tcp.cfg that lead to them. Thread: the poll loop's.
#pragma once
#include "sim/config.h"
#include "sim/server.h"

struct served *bench_served_new(const struct sim_config *config); // NULL without memory
