// SPDX-License-Identifier: MIT
#include "campaign/reduce.h"

#include "base/units.h"
#include "campaign/reduce_elements.h"
#include "campaign/reduce_references.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// --- which readings count ------------------------------------------------------------------------

// Walks plan and rows together; both are in the plan's order. Returns the last reading of the
// point that counts, or NULL.
static const struct store_reading *reading_of(const struct plan_point *p,
                                              const struct store_reading *rows, int count, int *at)
{
    const struct store_reading *found = NULL;
    for (; *at < count && rows[*at].sweep == p->sweep && rows[*at].point == p->point; (*at)++)
        if (store_reading_counts(&rows[*at]))
            found = &rows[*at];
    return found;
}

// --- noise ---------------------------------------------------------------------------------------

struct variance { // of one reading's samples
    double v2;    // square of the mean signal, over the largest
    double s2;    // sample variance
    double nu;    // degrees of freedom
};

// With variances a (1 + t v2) the likelihood's best a is known for each t: returns twice its
// negative logarithm there, without constants.
static double deviance(const struct variance *list, int n, double t, double *ret_a)
{
    double logs = 0, sum = 0, nu = 0;
    for (int i = 0; i < n; i++) {
        const double shape = 1 + t * list[i].v2;
        logs += list[i].nu * log(shape);
        sum += list[i].nu * list[i].s2 / shape;
        nu += list[i].nu;
    }
    *ret_a = sum / nu;
    return nu * log(sum / nu) + logs;
}

// Golden section in log t, between two values of it.
static double refine(const struct variance *list, int n, double low, double high)
{
    const double golden = 0.5 * (sqrt(5.0) - 1);
    double a;
    for (int k = 0; k < 40; k++) {
        const double left = high - golden * (high - low), right = low + golden * (high - low);
        if (deviance(list, n, exp(left), &a) < deviance(list, n, exp(right), &a))
            high = right;
        else
            low = left;
    }
    return exp(0.5 * (low + high));
}

// Signals span five decades and the beam stands alone at their top: scoring steps wander there, so
// t is searched over all its decades. t = 0 is a pure floor; at the other end the floor is nothing.
static void fit_variances(const struct variance *list, int n, double *ret_a, double *ret_b)
{
    double t = 0, a, best = deviance(list, n, 0, &a);
    for (double l = log(1e-3); l < log(1e16); l += 1) {
        const double d = deviance(list, n, exp(l), &a);
        if (d < best) {
            best = d;
            t = exp(l);
        }
    }
    if (t > 0)
        t = refine(list, n, log(t) - 1, log(t) + 1);
    deviance(list, n, t, ret_a);
    *ret_b = *ret_a * t;
}

struct reduce_noise reduce_noise_of(const struct plan *plan, const struct store_reading *rows,
                                    int count)
{
    struct reduce_noise noise = {(double)NAN, (double)NAN, 0};
    struct variance *list = calloc((size_t)plan->count + 1, sizeof *list);
    double largest = 0, scatter = 0, monitor = 0, monitor_nu = 0;
    int n = 0;
    for (int i = 0, at = 0; list && i < plan->count; i++) {
        const struct store_reading *r = reading_of(&plan->points[i], rows, count, &at);
        if (!r || r->count < 2)
            continue;
        list[n++] = (struct variance){r->signal_v * r->signal_v, r->signal_sd_v * r->signal_sd_v,
                                      r->count - 1.0};
        largest = fmax(largest, r->signal_v * r->signal_v);
        scatter += r->signal_sd_v;
        if (plan->points[i].kind != PLAN_DARK && isfinite(r->monitor_v) && r->monitor_v != 0) {
            const double rel = r->monitor_sd_v / r->monitor_v;
            monitor += (r->count - 1) * rel * rel;
            monitor_nu += r->count - 1;
        }
    }
    for (int i = 0; i < n && largest > 0; i++)
        list[i].v2 /= largest;
    if (scatter > 0) {
        double a, b;
        fit_variances(list, n, &a, &b);
        noise.floor_v = sqrt(a);
        noise.rel = largest > 0 ? sqrt(b / largest) : 0;
    }
    if (monitor_nu > 0)
        noise.rel_monitor = sqrt(monitor / monitor_nu);
    free(list);
    return noise;
}

static double sample_u_v(const struct reduce_noise *n, double signal_v)
{
    return hypot(n->floor_v, n->rel * signal_v);
}

static double without_nan(double value)
{
    return isnan(value) ? 0 : value;
}

// --- points --------------------------------------------------------------------------------------

static double cosine(const struct reduction *r, const struct reduced_point *p)
{
    return cos(units_rad(r->regime == BENCH_OVERFILLED ? p->theta_i_deg : p->theta_r_deg));
}

// False when this point has no value: at or below the horizon, or with the light gone.
static bool reduce_point(const struct reduction *r, const struct reduce_references *f,
                         const struct store_reading *row, const struct reduce_channel *channel,
                         struct reduced_point *p)
{
    const int64_t t_ms = row->t_utc_ms;
    const struct reduce_series *ratio = &f->beam[p->pol_in].ratio;
    const double dark_monitor_v = reduce_series_at(&f->dark_monitor, t_ms);
    const double beam_ratio =
        channel->beam_ratio * (reduce_series_at(ratio, t_ms) / reduce_series_mean(ratio));
    const double monitor = isnan(row->monitor_v) ? 1 : row->monitor_v - without_nan(dark_monitor_v);
    const double scale = 1 / (beam_ratio * r->omega_sr * cosine(r, p)); // f = scale (S - D) / M
    if (!(cosine(r, p) > 1e-6) || !(monitor > 0))
        return false;
    p->f_per_sr = scale * (row->signal_v - reduce_series_at(&f->dark_signal, t_ms)) / monitor;
    const double u_signal = sample_u_v(&r->noise, row->signal_v) / sqrt(row->count);
    const double u_monitor = r->noise.rel_monitor / sqrt(row->count);
    p->u_a_per_sr = hypot(scale * hypot(u_signal, r->u_dark_v) / monitor, p->f_per_sr * u_monitor);
    p->u_b_per_sr = fabs(p->f_per_sr) * channel->u_scale_rel;
    return isfinite(p->f_per_sr);
}

static int reduce_points(struct reduction *r, const struct reduce_references *f,
                         const struct plan *plan, const struct store_reading *rows, int count,
                         struct gon_error *err)
{
    r->points = calloc((size_t)plan->samples + 1, sizeof *r->points);
    if (!r->points)
        return gon_fail(err, GON_E_SYSTEM, "reduction: out of memory");
    for (int i = 0, at = 0; i < plan->count; i++) {
        const struct plan_point *point = &plan->points[i];
        const struct store_reading *row = reading_of(point, rows, count, &at);
        if (!row || point->kind != PLAN_SAMPLE)
            continue;
        struct reduced_point *p = &r->points[r->count];
        *p = (struct reduced_point){.sweep = row->sweep,
                                    .point = row->point,
                                    .attempt = row->attempt,
                                    .index = i,
                                    .pol_in = point->pol_in,
                                    .pol_out = point->pol_out,
                                    .theta_i_deg = units_deg_of_udeg(row->theta_i_udeg),
                                    .theta_r_deg = units_deg_of_udeg(row->theta_r_udeg),
                                    .weight = point->weight};
        if (reduce_point(r, f, row, reduce_channel_of(r, p->pol_in, p->pol_out), p))
            r->count++;
        else
            r->left_out++;
    }
    return GON_OK;
}

// --- all of it -----------------------------------------------------------------------------------

static int none_left(const char *what, int excluded, struct gon_error *err)
{
    return gon_fail(err, GON_E_INPUT,
                    "no %s reading is left, %d %s excluded: without one there is no absolute BRDF; "
                    "take one back: gonio restore",
                    what, excluded, excluded == 1 ? "is" : "are");
}

static int reduce_dark(struct reduction *r, const struct reduce_references *f,
                       struct gon_error *err)
{
    int excluded_beams = 0;
    r->darks = f->dark_signal.count;
    for (int i = 0; i < POL_COUNT; i++)
        r->beams += f->beam[i].signal.count;
    r->reference = reduce_reference_means(f);
    r->u_dark_v = hypot(reduce_series_u(&f->dark_signal),
                        without_nan(r->noise.floor_v) /
                            sqrt(reduce_series_samples(&f->dark_signal, f->dark_samples)));
    for (int i = 0; i < POL_COUNT; i++)
        excluded_beams += f->beam[i].excluded;
    if (!r->darks && f->dark_excluded)
        return none_left("dark", f->dark_excluded, err);
    if (r->darks && !r->beams && excluded_beams)
        return none_left("beam", excluded_beams, err);
    if (!r->darks || !r->beams)
        return gon_fail(err, GON_E_INPUT, "no %s reading yet: without it there is no absolute BRDF",
                        r->darks ? "beam" : "dark");
    return GON_OK;
}

static int check_beam(const struct reduction *r, const struct reduce_beam *beam, int pol_in,
                      struct gon_error *err)
{
    char what[40];
    const double ratio = reduce_series_mean(&beam->ratio);
    snprintf(what, sizeof what, "beam (pol_in = \"%s\")",
             polarisation_name((enum polarisation)pol_in));
    if (!beam->signal.count && beam->excluded)
        return none_left(what, beam->excluded, err);
    if (!beam->signal.count)
        return gon_fail(err, GON_E_INPUT,
                        "no beam reading yet of pol_in = \"%s\": without it there is no absolute "
                        "BRDF",
                        polarisation_name((enum polarisation)pol_in));
    if (reduce_series_least(&beam->ratio) > 0 && isfinite(ratio))
        return GON_OK;
    return gon_fail(err, GON_E_INPUT,
                    "the beam (%.4g V, monitor %.4g V) is not above the dark (%.4g V, monitor "
                    "%.4g V); look at station 'beam', laser and monitor",
                    r->reference.beam_signal_v[pol_in], r->reference.beam_monitor_v[pol_in],
                    r->reference.dark_signal_v, r->reference.dark_monitor_v);
}

static int add_channel(struct reduction *r, const struct reduce_references *f,
                       const struct bench_config *bench, const struct plan_point *p,
                       struct gon_error *err)
{
    const struct reduce_beam *beam = &f->beam[p->pol_in];
    struct reduce_channel *c = &r->channel[r->channels];
    int rc = check_beam(r, beam, p->pol_in, err);
    if (rc < 0)
        return rc;
    const double ratio = reduce_series_mean(&beam->ratio),
                 signal_v = r->reference.beam_signal_v[p->pol_in];
    const double noise = without_nan(sample_u_v(&r->noise, signal_v)) / signal_v;
    const double shared = hypot(r->u_radius_rel, hypot(r->u_distance_rel, r->u_linearity_rel));
    *c = (struct reduce_channel){.pol_in = p->pol_in, .pol_out = p->pol_out};
    c->beam_ratio = ratio * reduce_analyser(&bench->polarisation, p->pol_in, beam->out, p->pol_out,
                                            &c->u_analyser_rel);
    c->beam_ratio /= bench_beam_passes(bench, &c->u_filter_rel);
    c->u_beam_rel = hypot(reduce_series_u(&beam->ratio) / ratio,
                          hypot(noise, r->noise.rel_monitor) /
                              sqrt(reduce_series_samples(&beam->ratio, beam->samples)));
    c->u_scale_rel = hypot(hypot(c->u_beam_rel, hypot(c->u_analyser_rel, c->u_filter_rel)), shared);
    r->u_beam_rel = fmax(r->u_beam_rel, c->u_beam_rel);
    r->u_scale_rel = fmax(r->u_scale_rel, c->u_scale_rel);
    r->polarisation = p->pol_in == POL_UNKNOWN || !r->channels ? p->pol_in : r->polarisation;
    r->channels++;
    return GON_OK;
}

static int reduce_channels(struct reduction *r, const struct reduce_references *f,
                           const struct bench_config *bench, const struct plan *plan,
                           struct gon_error *err)
{
    int rc = GON_OK;
    for (int i = 0; i < plan->count && rc >= 0; i++) {
        const struct plan_point *p = &plan->points[i];
        if (p->kind == PLAN_SAMPLE && !reduce_channel_of(r, p->pol_in, p->pol_out))
            rc = r->channels < CAMPAIGN_CHANNELS
                     ? add_channel(r, f, bench, p, err)
                     : gon_fail(err, GON_E_INPUT, "the plan has more states than there are");
    }
    return rc;
}

int reduce_run(const struct bench_config *bench, const struct plan *plan,
               const struct store_reading *rows, int count, struct reduction *ret_reduction,
               struct gon_error *err)
{
    struct reduction r = {.omega_sr = bench_omega_sr(bench), .regime = bench->regime};
    struct reduce_references f;
    r.noise = reduce_noise_of(plan, rows, count);
    for (int i = 0; i < count; i++)
        r.excluded += !(rows[i].flags & STORE_REJECTING) && !store_reading_counts(&rows[i]);
    r.u_radius_rel = 2 * bench->u_aperture_radius_mm / bench->aperture_radius_mm;
    r.u_distance_rel = 2 * bench->u_distance_mm / bench->distance_mm;
    r.u_linearity_rel = bench->detector.u_linearity_rel;
    int rc = reduce_references_of(plan, rows, count, &f, err);
    if (rc >= 0)
        rc = reduce_dark(&r, &f, err);
    if (rc >= 0)
        rc = reduce_channels(&r, &f, bench, plan, err);
    if (rc >= 0)
        rc = reduce_points(&r, &f, plan, rows, count, err);
    reduce_references_clear(&f);
    if (rc < 0)
        return rc;
    reduce_add_leaks(&r, plan, bench);
    *ret_reduction = r;
    return GON_OK;
}

int reduce_campaign(struct store *s, struct reduction *ret_reduction, struct gon_error *err)
{
    struct bench_config bench;
    struct plan plan = {0};
    struct store_reading *rows = NULL;
    int rc = store_read_bench(s, &bench, err);
    if (rc >= 0)
        rc = store_read_plan(s, &plan, err);
    if (rc >= 0)
        rc = store_read_readings(s, -1, &rows, err);
    if (rc >= 0)
        rc = reduce_run(&bench, &plan, rows, rc, ret_reduction, err);
    plan_clear(&plan);
    free(rows);
    return rc;
}

void reduction_clear(struct reduction *r)
{
    if (!r)
        return;
    free(r->points);
    *r = (struct reduction){0};
}

int reduction_warning(const struct reduction *r, char *text, size_t size)
{
    return snprintf(text, size, "%s",
                    r->polarisation == POL_UNKNOWN
                        ? "the laser's polarisation is unknown: f_r is f_00 + m f_01 with unknown "
                          "m, fitted as if it were f_00"
                        : "");
}
