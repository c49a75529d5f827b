// SPDX-License-Identifier: MIT
// Private to campaign/plan*.c: the bench that a plan is made for, and where it stands while the
// plan grows. It goes the way that daemon/travel.h would, in thought.
#pragma once
#include "campaign/bench.h"
#include "campaign/plan.h"

struct plan_bench {
    const struct bench_config
        *bench; // NULL: none; then everything can be reached and costs nothing
    struct kinematics kinematics;
    double at[BENCH_AXES]; // of the last point; NAN: not known
    double moves_s;        // so far
};

int plan_bench_init(struct plan_bench *p, const struct bench_config *bench, struct gon_error *err);
// Goes to a direction of the sample, or says why it stays: a reason, and for PLAN_SKIP_KEEP_OUT the
// keep-out. Returns whether it went.
bool plan_bench_go(struct plan_bench *p, double theta_i_deg, double theta_r_deg,
                   enum plan_skip_reason *ret_reason, int *ret_keep_out);
// GON_E_INPUT: there is no way to it. A station that the bench has not is where it is.
int plan_bench_go_station(struct plan_bench *p, const char *name, struct gon_error *err);
