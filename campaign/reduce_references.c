// SPDX-License-Identifier: MIT
#include "campaign/reduce_references.h"

#include <math.h>

static void mean_add(struct reduce_mean *m, double value)
{
    m->sum += value;
    m->least = m->n ? fmin(m->least, value) : value;
    m->most = m->n ? fmax(m->most, value) : value;
    m->n++;
}

double reduce_mean_of(const struct reduce_mean *m)
{
    return m->n ? m->sum / m->n : (double)NAN;
}

double reduce_mean_u(const struct reduce_mean *m)
{
    return m->n < 2 ? 0 : 0.5 * (m->most - m->least);
}

static double without_nan(double value)
{
    return isnan(value) ? 0 : value;
}

// Returns how many accepted readings of it do not count.
static int each_reference(const struct plan_point *p, const struct store_reading *rows, int count,
                          int *at,
                          void (*add)(struct reduce_references *f, const struct plan_point *p,
                                      const struct store_reading *r),
                          struct reduce_references *f)
{
    int excluded = 0;
    for (; *at < count && rows[*at].sweep == p->sweep && rows[*at].point == p->point; (*at)++)
        if (store_reading_counts(&rows[*at]))
            add(f, p, &rows[*at]);
        else
            excluded += !(rows[*at].flags & STORE_REJECTING);
    return excluded;
}

static void add_dark(struct reduce_references *f, const struct plan_point *p,
                     const struct store_reading *r)
{
    (void)p;
    mean_add(&f->dark_signal, r->signal_v);
    mean_add(&f->dark_monitor, r->monitor_v);
    f->dark_samples += r->count;
}

static void add_beam(struct reduce_references *f, const struct plan_point *p,
                     const struct store_reading *r)
{
    struct reduce_beam *b = &f->beam[p->pol_in];
    const double dark_signal = reduce_mean_of(&f->dark_signal),
                 dark_monitor = reduce_mean_of(&f->dark_monitor);
    const double monitor = isnan(r->monitor_v) ? 1 : r->monitor_v - without_nan(dark_monitor);
    mean_add(&b->signal, r->signal_v);
    mean_add(&b->monitor, r->monitor_v);
    mean_add(&b->ratio, (r->signal_v - dark_signal) / monitor);
    b->samples += r->count;
    b->out = p->pol_out;
}

static void pass_over(struct reduce_references *f, const struct plan_point *p,
                      const struct store_reading *r)
{
    (void)f;
    (void)p;
    (void)r;
}

static void add_darks(struct reduce_references *f, const struct plan *plan,
                      const struct store_reading *rows, int count, int last_sweep)
{
    for (int i = 0, at = 0; i < plan->count && plan->points[i].sweep <= last_sweep; i++) {
        const bool dark = plan->points[i].kind == PLAN_DARK;
        const int excluded =
            each_reference(&plan->points[i], rows, count, &at, dark ? add_dark : pass_over, f);
        f->dark_excluded += dark ? excluded : 0;
    }
}

static void add_beams(struct reduce_references *f, const struct plan *plan,
                      const struct store_reading *rows, int count, int last_sweep)
{
    for (int i = 0, at = 0; i < plan->count && plan->points[i].sweep <= last_sweep; i++) {
        const bool beam = plan->points[i].kind == PLAN_BEAM;
        const int excluded =
            each_reference(&plan->points[i], rows, count, &at, beam ? add_beam : pass_over, f);
        f->beam[plan->points[i].pol_in].excluded += beam ? excluded : 0;
    }
}

struct reduce_reference reduce_reference_means(const struct reduce_references *f)
{
    struct reduce_reference r = {
        reduce_mean_of(&f->dark_signal), reduce_mean_of(&f->dark_monitor), {0}, {0}};
    for (int i = 0; i < POL_COUNT; i++) {
        r.beam_signal_v[i] = reduce_mean_of(&f->beam[i].signal);
        r.beam_monitor_v[i] = reduce_mean_of(&f->beam[i].monitor);
    }
    return r;
}

struct reduce_references reduce_references_of(const struct plan *plan,
                                              const struct store_reading *rows, int count,
                                              int last_sweep)
{
    struct reduce_references f = {0};
    add_darks(&f, plan, rows, count, last_sweep);
    add_beams(&f, plan, rows, count, last_sweep);
    return f;
}

struct reduce_reference reduce_opening(const struct plan *plan, const struct store_reading *rows,
                                       int count)
{
    const struct reduce_references f = reduce_references_of(plan, rows, count, 0);
    return reduce_reference_means(&f);
}
