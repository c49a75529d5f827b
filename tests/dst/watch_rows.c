// SPDX-License-Identifier: MIT
// The rules about values and rows.
#include "tests/dst/watch.h"

#include "base/units.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PRINTED_REL 6e-6 // the detector says six digits
#define NOISE_SIGMAS 7.0 // 1e-12 by chance
#define SETTLED_REL 5e-4 // of the signal: the filter's rest, and the laser's noise of 1e-4 rms
#define STEP_DEG 0.0015  // the encoder's step, and half
#define PLAY_DEG 0.0155  // of the drive, where the approach does not take it up
#define PLAN_DEG 0.0075  // two deadbands and a step
#define FALLEN_V 1e-9    // what is left of the beam
#define SETTLE_TC 40     // after another dark, of the filter's time constants

static bool is_accepted(const struct store_reading *row)
{
    return !(row->flags & STORE_REJECTING);
}

// Points of a sweep count up without a gap.
static const struct plan_point *planned(const struct watch *w, int sweep, int point, int *ret_index)
{
    if (sweep < 0 || sweep > w->plan->sweeps + 1)
        return NULL;
    const int i = w->first[sweep] + point - w->plan->points[w->first[sweep]].point;
    if (i < 0 || i >= w->plan->count || w->plan->points[i].sweep != sweep ||
        w->plan->points[i].point != point)
        return NULL;
    *ret_index = i;
    return &w->plan->points[i];
}

// --- what the detector says ----------------------------------------------------------------------

void watch_heard(struct watch *w, const uint8_t *bytes, size_t size)
{
    struct world *world = &w->rig->bench.world;
    if (!memmem(bytes, size, "SNAP", 4))
        return;
    if (w->samples == WATCH_SAMPLES) { // the oldest are of no use any more
        memmove(w->sample, w->sample + WATCH_SAMPLES / 2, sizeof w->sample / 2);
        w->samples = WATCH_SAMPLES / 2;
    }
    const struct lockin *l = &world->lockin;
    struct watch_sample *s = &w->sample[w->samples++];
    *s = (struct watch_sample){
        .t_ns = os.now_ns,
        .x_v = lockin_x_v(l),
        .truth_v = world_input_v(world, os.now_ns),
        .monitor_v = world->spec.monitor_dark_v +
                     world->spec.monitor_v_per_w * sim_laser_power_w(&world->laser),
        .noise_v = l->noise_v_per_rthz / sqrt(8 * l->time_constant_s) + l->full_scale_v / 65536,
        .still = true,
        .emits = sim_laser_emits(&world->laser)};
    for (int i = 0; i < RIG_AXES; i++) {
        const struct motion_state m = motion_at(&world->axis[i], os.now_ns);
        s->motor[i] = m.motor;
        s->load[i] = m.load;
        s->still = s->still && !m.moving;
    }
}

// --- a row ---------------------------------------------------------------------------------------

// Samples whose mean the row is, among those from at on; the newest first, so that the usual case
// is found at once.
struct choice {
    const struct watch *w;
    const struct store_reading *row;
    int left; // tries
    int taken[WATCH_SAMPLES];
};

static bool choose(struct choice *c, int at, int have, double sum_v)
{
    const struct store_reading *r = c->row;
    if (have == r->count)
        return fabs(sum_v / have - r->signal_v) <=
               PRINTED_REL * fmax(fabs(r->signal_v), fabs(sum_v / have)) + 1e-15;
    for (int i = at; i >= 0 && i + 1 >= r->count - have && c->left-- > 0; i--) {
        c->taken[have] = i;
        if (choose(c, i - 1, have + 1, sum_v + c->w->sample[i].x_v))
            return true;
    }
    return false;
}

static void check_place(struct watch *w, const struct store_reading *row,
                        const struct plan_point *p, const struct watch_sample *s)
{
    const double at[2] = {units_deg_of_udeg(row->theta_i_udeg),
                          units_deg_of_udeg(row->theta_r_udeg)};
    const double plan[2] = {p->theta_i_deg, p->theta_r_deg};
    if (!s->still)
        watch_violate(w, WATCH_VALUES, "sweep %d, point %d was read while an axis moved",
                      row->sweep, row->point);
    for (int i = 0; i < 2; i++) {
        const double step =
            w->rig->gate[i].frozen ? PLAN_DEG : STEP_DEG; // it stopped on its way in
        if (fabs(s->motor[i] - at[i]) > step || fabs(s->load[i] - at[i]) > PLAY_DEG)
            watch_violate(w, WATCH_VALUES,
                          "sweep %d, point %d says %s %.4f, it was %.4f (load %.4f)", row->sweep,
                          row->point, world_axis_names[i], at[i], s->motor[i], s->load[i]);
        if (p->kind != PLAN_DARK && fabs(at[i] - plan[i]) > PLAN_DEG)
            watch_violate(w, WATCH_VALUES, "sweep %d, point %d was read at %s %.4f instead of %.4f",
                          row->sweep, row->point, world_axis_names[i], at[i], plan[i]);
    }
}

static void check_light(struct watch *w, const struct store_reading *row,
                        const struct plan_point *p, const struct watch_sample *s)
{
    if (s->emits == (p->kind == PLAN_DARK))
        watch_violate(w, WATCH_VALUES, "sweep %d, point %d (%s) was read with the light %s",
                      row->sweep, row->point, plan_kind_name(p->kind), s->emits ? "on" : "off");
}

static void check_truth(struct watch *w, const struct store_reading *row, double truth_v,
                        double noise_v, double monitor_v)
{
    const double off_v = fabs(row->signal_v - truth_v);
    if (off_v > NOISE_SIGMAS * noise_v + SETTLED_REL * fabs(truth_v) + FALLEN_V)
        watch_violate(w, WATCH_VALUES, "sweep %d, point %d is %.6g V where the world has %.6g V",
                      row->sweep, row->point, row->signal_v, truth_v);
    if (fabs(row->monitor_v - monitor_v) > 0.002 + 0.002 * monitor_v)
        watch_violate(w, WATCH_VALUES,
                      "sweep %d, point %d: monitor %.5g V where the world has %.5g V", row->sweep,
                      row->point, row->monitor_v, monitor_v);
}

void watch_offered(struct watch *w, const struct store_reading *row)
{
    int index;
    const struct plan_point *p = planned(w, row->sweep, row->point, &index);
    struct choice c = {.w = w, .row = row, .left = 20000};
    const double time_constant_s = w->rig->bench.world.lockin.time_constant_s;
    double truth_v = 0, monitor_v = 0, noise_v = 0;
    bool steady = true; // the world itself did not change meanwhile, which nobody could see
    if (!p || !isfinite(row->signal_v) || row->count < 1) {
        watch_violate(w, WATCH_VALUES, "sweep %d, point %d: no such row can be", row->sweep,
                      row->point);
        return;
    }
    if (!choose(&c, w->samples - 1, 0, 0)) {
        if (!is_accepted(row)) // an answer that was another question's: it is known to be none
            return;
        watch_violate(w, WATCH_VALUES, "sweep %d, point %d: %.7g V was never measured", row->sweep,
                      row->point, row->signal_v);
        return;
    }
    for (int i = 0; i < row->count; i++) {
        const struct watch_sample *s = &w->sample[c.taken[i]];
        truth_v += s->truth_v / row->count;
        monitor_v += s->monitor_v / row->count;
        noise_v = s->noise_v;
        steady = steady && s->t_ns > w->world_ns + OS_S(SETTLE_TC * time_constant_s);
        if (!is_accepted(row)) // what is wrong with it is said
            continue;
        check_place(w, row, p, s);
        check_light(w, row, p, s);
    }
    if (is_accepted(row) && steady)
        check_truth(w, row, truth_v, noise_v, monitor_v);
    w->samples = 0;
}

void watch_acknowledged(struct watch *w, const struct store_reading *row)
{
    int index = 0;
    if (w->rows == w->room) {
        w->room = w->room ? 2 * w->room : 4096;
        w->row = realloc(w->row, (size_t)w->room * sizeof *w->row);
        if (!w->row)
            abort();
    }
    w->row[w->rows++] = *row;
    if (!planned(w, row->sweep, row->point, &index) || !is_accepted(row))
        return;
    const int again = w->accepted[index];
    w->accepted[index] += again < 255;
    if (again > (row->sweep == 0 ? w->gaps : 0))
        watch_violate(w, WATCH_ROWS, "sweep %d, point %d was accepted twice, %d gaps", row->sweep,
                      row->point, w->gaps);
}

// --- the file ------------------------------------------------------------------------------------

static int by_place(const void *a, const void *b)
{
    const struct store_reading *x = a, *y = b;
    return x->sweep != y->sweep   ? x->sweep - y->sweep
           : x->point != y->point ? x->point - y->point
                                  : x->attempt - y->attempt;
}

static bool same(const struct store_reading *a, const struct store_reading *b)
{
    return by_place(a, b) == 0 && a->t_utc_ms == b->t_utc_ms &&
           a->theta_i_udeg == b->theta_i_udeg && a->theta_r_udeg == b->theta_r_udeg &&
           a->signal_v == b->signal_v && a->signal_sd_v == b->signal_sd_v &&
           a->monitor_v == b->monitor_v && a->count == b->count && a->range == b->range &&
           a->flags == b->flags;
}

void watch_file(struct watch *w, const struct store_reading *rows, int count)
{
    int lost = 0, more = 0;
    qsort(w->row, (size_t)w->rows, sizeof *w->row, by_place);
    for (int i = 0, k = 0; i < w->rows || k < count;) {
        const int order = i == w->rows ? 1 : k == count ? -1 : by_place(&w->row[i], &rows[k]);
        lost += order < 0 || (order == 0 && !same(&w->row[i], &rows[k]));
        more += order > 0;
        i += order <= 0;
        k += order >= 0;
    }
    if (lost)
        watch_violate(w, WATCH_ROWS, "%d of %d acknowledged rows are not in the file as they were",
                      lost, w->rows);
    if (more > 1) // a stop may leave one that was written and not yet acknowledged
        watch_violate(w, WATCH_ROWS, "%d rows are in the file that nobody was told of", more);
}
