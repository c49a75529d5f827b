// SPDX-License-Identifier: MIT
#include "campaign/reduce_references.h"

#include <math.h>

static double without_nan(double value)
{
    return isnan(value) ? 0 : value;
}

// The next reading of the point that counts; NULL: no more.
static const struct store_reading *next_of(const struct plan_point *p,
                                           const struct store_reading *rows, int count, int *at)
{
    for (; *at < count && rows[*at].sweep == p->sweep && rows[*at].point == p->point; (*at)++)
        if (store_reading_counts(&rows[*at]))
            return &rows[(*at)++];
    return NULL;
}

static const struct store_reading *newest_of(const struct plan_point *p,
                                             const struct store_reading *rows, int count, int *at)
{
    const struct store_reading *r, *newest = NULL;
    while ((r = next_of(p, rows, count, at)))
        newest = r;
    return newest;
}

static int add_dark(struct reduce_references *f, const struct store_reading *r,
                    struct gon_error *err)
{
    int rc = reduce_series_add(&f->dark_signal, r->t_utc_ms, r->signal_v, err);
    f->dark_samples += r->count;
    return rc < 0 ? rc : reduce_series_add(&f->dark_monitor, r->t_utc_ms, r->monitor_v, err);
}

static int add_beam(struct reduce_references *f, const struct plan_point *p,
                    const struct store_reading *r, struct gon_error *err)
{
    struct reduce_beam *b = &f->beam[p->pol_in];
    const double dark_signal = reduce_series_at(&f->dark_signal, r->t_utc_ms);
    const double dark_monitor = reduce_series_at(&f->dark_monitor, r->t_utc_ms);
    const double monitor = isnan(r->monitor_v) ? 1 : r->monitor_v - without_nan(dark_monitor);
    int rc = reduce_series_add(&b->signal, r->t_utc_ms, r->signal_v, err);
    rc = rc < 0 ? rc : reduce_series_add(&b->monitor, r->t_utc_ms, r->monitor_v, err);
    b->samples += r->count;
    b->out = p->pol_out;
    b->ratio.interpolated = f->again;
    return rc < 0 ? rc
                  : reduce_series_add(&b->ratio, r->t_utc_ms, (r->signal_v - dark_signal) / monitor,
                                      err);
}

static bool was_measured_again(const struct plan *plan, const struct store_reading *rows, int count)
{
    for (int i = 0, at = 0; i < plan->count; i++) {
        int good = 0;
        while (next_of(&plan->points[i], rows, count, &at))
            good++;
        if (plan->points[i].kind != PLAN_SAMPLE && good > 1)
            return true;
    }
    return false;
}

// Accepted readings that do not count, as somebody decided.
static void count_excluded(struct reduce_references *f, const struct plan *plan,
                           const struct store_reading *rows, int count)
{
    for (int i = 0, at = 0; i < plan->count; i++) {
        const struct plan_point *p = &plan->points[i];
        int n = 0;
        for (; at < count && rows[at].sweep == p->sweep && rows[at].point == p->point; at++)
            n += !(rows[at].flags & STORE_REJECTING) && !store_reading_counts(&rows[at]);
        f->dark_excluded += p->kind == PLAN_DARK ? n : 0;
        f->beam[p->pol_in].excluded += p->kind == PLAN_BEAM ? n : 0;
    }
}

static int add_references(struct reduce_references *f, enum plan_kind kind, const struct plan *plan,
                          const struct store_reading *rows, int count, struct gon_error *err)
{
    const struct store_reading *r;
    int rc = GON_OK;
    for (int i = 0, at = 0; i < plan->count && rc >= 0; i++) {
        const struct plan_point *p = &plan->points[i];
        while (rc >= 0 && (r = next_of(p, rows, count, &at)))
            rc = p->kind != kind     ? GON_OK
                 : kind == PLAN_DARK ? add_dark(f, r, err)
                                     : add_beam(f, p, r, err);
    }
    return rc;
}

// The darks first: the beams are over them.
int reduce_references_of(const struct plan *plan, const struct store_reading *rows, int count,
                         struct reduce_references *ret_references, struct gon_error *err)
{
    struct reduce_references *f = ret_references;
    *f = (struct reduce_references){.again = was_measured_again(plan, rows, count)};
    count_excluded(f, plan, rows, count);
    f->dark_signal.interpolated = f->dark_monitor.interpolated = f->again;
    int rc = add_references(f, PLAN_DARK, plan, rows, count, err);
    return rc < 0 ? rc : add_references(f, PLAN_BEAM, plan, rows, count, err);
}

void reduce_references_clear(struct reduce_references *f)
{
    reduce_series_clear(&f->dark_signal);
    reduce_series_clear(&f->dark_monitor);
    for (int i = 0; i < POL_COUNT; i++) {
        reduce_series_clear(&f->beam[i].signal);
        reduce_series_clear(&f->beam[i].monitor);
        reduce_series_clear(&f->beam[i].ratio);
    }
}

struct reduce_reference reduce_reference_means(const struct reduce_references *f)
{
    struct reduce_reference r = {
        reduce_series_mean(&f->dark_signal), reduce_series_mean(&f->dark_monitor), {0}, {0}};
    for (int i = 0; i < POL_COUNT; i++) {
        r.beam_signal_v[i] = reduce_series_mean(&f->beam[i].signal);
        r.beam_monitor_v[i] = reduce_series_mean(&f->beam[i].monitor);
    }
    return r;
}

struct reduce_reference reduce_opening(const struct plan *plan, const struct store_reading *rows,
                                       int count)
{
    struct reduce_reference o = {(double)NAN, (double)NAN, {0}, {0}};
    for (int i = 0; i < POL_COUNT; i++)
        o.beam_signal_v[i] = o.beam_monitor_v[i] = (double)NAN;
    for (int i = 0, at = 0; i < plan->count && plan->points[i].sweep == 0; i++) {
        const struct plan_point *p = &plan->points[i];
        const struct store_reading *r = newest_of(p, rows, count, &at);
        if (r && p->kind == PLAN_DARK) {
            o.dark_signal_v = r->signal_v;
            o.dark_monitor_v = r->monitor_v;
        } else if (r && p->kind == PLAN_BEAM) {
            o.beam_signal_v[p->pol_in] = r->signal_v;
            o.beam_monitor_v[p->pol_in] = r->monitor_v;
        }
    }
    return o;
}
