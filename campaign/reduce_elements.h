// SPDX-License-Identifier: MIT
// What the elements of polarisation do to a reduction; the formulas are in campaign/reduce.h.
// Thread: any.
#pragma once
#include "campaign/reduce.h"

// NULL: the plan has no such channel.
const struct reduce_channel *reduce_channel_of(const struct reduction *r, int pol_in, int pol_out);

// What a reading is divided by because of the analyser: what it passed of the sample's light over
// what it passed of the beam's, measured at beam_out. 1 on a bench without pol_out states.
double reduce_analyser(const struct bench_polarisation *p, int pol_in, int beam_out, int pol_out,
                       double *ret_u_rel);

// What the elements let through of crossed light, into u_B of the reduced points.
void reduce_add_leaks(struct reduction *r, const struct plan *plan, const struct bench_config *b);
