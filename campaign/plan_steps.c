// SPDX-License-Identifier: MIT
#include "campaign/plan_steps.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct bench_station *find(const struct bench_config *bench, const char *name)
{
    return bench && *name ? bench_find_station(bench, name) : NULL;
}

static const char *before_sweep(const struct campaign_config *c, int sweep)
{
    for (int i = 0; i < c->steps_count; i++)
        if (c->steps[i].before_sweep == sweep)
            return c->steps[i].text;
    return NULL;
}

enum plan_step_kind plan_next_step(const struct campaign_config *config,
                                   const struct bench_config *bench, const struct plan *plan,
                                   int index, const char *station, bool begun,
                                   const char **ret_text)
{
    const struct plan_point *p = &plan->points[index];
    const bool goes = strcmp(station, p->station) != 0;
    const bool first = index == 0 || plan->points[index - 1].sweep != p->sweep;
    const struct bench_station *from = find(bench, station), *to = find(bench, p->station);
    const char *sweeps = first && !begun ? before_sweep(config, p->sweep) : NULL;
    if (goes && from && *from->leave) {
        *ret_text = from->leave;
        return PLAN_STEP_LEAVE;
    }
    if (sweeps) {
        *ret_text = sweeps;
        return PLAN_STEP_SWEEP;
    }
    if (goes && to && *to->arrive) {
        *ret_text = to->arrive;
        return PLAN_STEP_ARRIVE;
    }
    return PLAN_STEP_NONE;
}

static int add(struct plan *plan, int index, const char *text, struct gon_error *err)
{
    struct plan_step *larger =
        realloc(plan->steps, (size_t)(plan->steps_count + 1) * sizeof *larger);
    if (!larger)
        return gon_fail(err, GON_E_SYSTEM, "plan: out of memory");
    plan->steps = larger;
    struct plan_step *s = &plan->steps[plan->steps_count++];
    *s = (struct plan_step){.before = index, .sweep = plan->points[index].sweep};
    snprintf(s->text, sizeof s->text, "%s", text);
    return GON_OK;
}

int plan_add_steps(const struct campaign_config *config, const struct bench_config *bench,
                   struct plan *plan, struct gon_error *err)
{
    const char *station = "", *text;
    for (int i = 0; i < plan->count; i++) {
        bool begun = false;
        for (;;) {
            const enum plan_step_kind kind =
                plan_next_step(config, bench, plan, i, station, begun, &text);
            if (kind == PLAN_STEP_NONE)
                break;
            int rc = add(plan, i, text, err);
            if (rc < 0)
                return rc;
            begun = begun || kind == PLAN_STEP_SWEEP;
            station = kind == PLAN_STEP_LEAVE    ? ""
                      : kind == PLAN_STEP_ARRIVE ? plan->points[i].station
                                                 : station;
        }
        station = plan->points[i].station;
    }
    return GON_OK;
}
