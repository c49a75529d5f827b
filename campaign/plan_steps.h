// SPDX-License-Identifier: MIT
// What a person has to do on the way through a plan: when the bench leaves or comes to a station
// that asks for it (bench_station), and before a sweep (campaign_config). Thread: any.
#pragma once
#include "campaign/bench.h"
#include "campaign/config.h"
#include "campaign/plan.h"

enum plan_step_kind {
    PLAN_STEP_NONE,
    PLAN_STEP_LEAVE, // a station
    PLAN_STEP_SWEEP,
    PLAN_STEP_ARRIVE
};

// The next one before the plan's point at index, the bench standing at a station ("": on the
// sample); begun: the sweep's own step was done. Bench may be NULL. Done, a leave means that it
// stands at "", an arrive that it stands at the point's station.
enum plan_step_kind plan_next_step(const struct campaign_config *config,
                                   const struct bench_config *bench, const struct plan *plan,
                                   int index, const char *station, bool begun,
                                   const char **ret_text);
// All of them in order, into the plan. GON_E_SYSTEM.
int plan_add_steps(const struct campaign_config *config, const struct bench_config *bench,
                   struct plan *plan, struct gon_error *err);
