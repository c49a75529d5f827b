// SPDX-License-Identifier: MIT
// The plan's states of polarisation against what the bench can make of them. Thread: any.
#pragma once
#include "base/err.h"
#include "campaign/plan.h"

// What stands before the detector while the beam of a state is measured: nothing (POL_U) where the
// analyser can be taken out; else the analyser parallel to the light, or a state that passes some
// of it; and what the campaign has where no element moves.
int plan_beam_out(const struct campaign_config *config, const struct bench_config *bench, int in);

// The time that the elements need from one point to the next; 0 where nothing moves.
double plan_states_move_s(const struct bench_config *bench, const struct plan_point *from,
                          const struct plan_point *to);

// One sentence about a state that the bench has not, for the dry run; returns the length that
// snprintf would, 0: nothing to say. in: of the light, else of the analyser.
int plan_state_warning(const struct bench_config *bench, bool in, int state, char *text,
                       size_t size);

// Before a campaign begins. GON_E_INPUT: the plan asks for a state that no element of the bench
// makes, where elements move or where there are several states (a single state without any element
// is the operator's); or no state of the analyser lets one of the beams through.
int plan_check_states(const struct plan *plan, const struct bench_config *bench,
                      struct gon_error *err);
