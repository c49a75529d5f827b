// SPDX-License-Identifier: MIT
#include "campaign/plan_bench.h"

#include "campaign/keepout.h"

#include <math.h>
#include <string.h>

int plan_bench_init(struct plan_bench *p, const struct bench_config *bench, struct gon_error *err)
{
    *p = (struct plan_bench){.bench = bench};
    for (int i = 0; i < BENCH_AXES; i++)
        p->at[i] = (double)NAN;
    return bench ? bench_kinematics(bench, &p->kinematics, err) : GON_OK;
}

static bool knows(const struct plan_bench *p)
{
    for (int i = 0; i < p->bench->axes_count; i++)
        if (kinematics_steers(&p->kinematics, i) && isnan(p->at[i]))
            return false;
    return true;
}

// The axes of a stage move together, the stages one after the other.
static double way_s(const struct plan_bench *p, const struct keepout_way *way)
{
    double total_s = 0, at[BENCH_AXES];
    memcpy(at, p->at, sizeof at);
    for (int n = 0; n < way->stages; n++) {
        const struct keepout_stage *stage = &way->stage[n];
        double slowest_s = 0;
        for (int i = 0; i < p->bench->axes_count; i++) {
            const bool moves = stage->axes >> i & 1 && !isnan(stage->to[i]);
            if (moves && !isnan(at[i]))
                slowest_s =
                    fmax(slowest_s, bench_axis_move_s(&p->bench->axes[i], at[i], stage->to[i]));
            if (moves)
                at[i] = stage->to[i];
        }
        total_s += slowest_s;
    }
    return total_s;
}

static int go(struct plan_bench *p, const double to[BENCH_AXES], struct gon_error *err)
{
    struct keepout_way way = {0};
    int rc = knows(p) ? keepout_find_way(p->bench, &p->kinematics, p->at, to, &way, err) : GON_OK;
    if (rc < 0)
        return rc;
    p->moves_s += way_s(p, &way);
    for (int i = 0; i < p->bench->axes_count; i++)
        p->at[i] = isnan(to[i]) ? p->at[i] : to[i];
    return GON_OK;
}

bool plan_bench_go(struct plan_bench *p, double theta_i_deg, double theta_r_deg,
                   enum plan_skip_reason *ret_reason, int *ret_keep_out)
{
    const struct bench_config *b = p->bench;
    const struct kinematics_pose pose = {theta_i_deg, theta_r_deg, 0, (double)NAN, (double)NAN};
    double to[BENCH_AXES];
    if (!b)
        return true;
    bool within = kinematics_inverse(&p->kinematics, &pose, to, NULL) >= 0;
    for (int i = 0; i < b->axes_count && within; i++)
        within = isnan(to[i]) || bench_axis_in_sweep(&b->axes[i], to[i]);
    *ret_reason = PLAN_SKIP_LIMITS;
    if (!within)
        return false;
    const int sample = bench_axis_index(b, "sample");
    if (sample >= 0)
        to[sample] = 0;
    *ret_reason = PLAN_SKIP_KEEP_OUT;
    *ret_keep_out = keepout_at(b, theta_i_deg, theta_r_deg);
    if (*ret_keep_out >= 0)
        return false;
    *ret_reason = PLAN_SKIP_CUT_OFF;
    return go(p, to, NULL) >= 0;
}

int plan_bench_go_station(struct plan_bench *p, const char *name, struct gon_error *err)
{
    const struct bench_station *s = p->bench ? bench_find_station(p->bench, name) : NULL;
    double to[BENCH_AXES];
    int rc = s ? bench_station_at(p->bench, &p->kinematics, s, to, err) : GON_OK;
    if (rc >= 0 && s)
        rc = go(p, to, err);
    return rc < 0 ? gon_prefix(err, "station %s", name) : rc;
}
