// SPDX-License-Identifier: MIT
#include "campaign/plan.h"

#include "base/units.h"
#include "campaign/plan_bench.h"
#include "campaign/plan_states.h"
#include "campaign/plan_steps.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_WARNINGS = 32, MOST_DIRECTIONS = 40000 };

#define GRAZING_DEG 85.0
#define OVERHEAD_S 0.03  // commands and answers of a point
#define RESIDUAL 1e-4    // of a step, when the filter counts as settled
#define CORRELATION 0.05 // between samples that count as independent
#define LONG_S (24 * 3600.0)

struct maker {
    const struct campaign_config *config;
    const struct bench_config *bench;
    struct plan plan;
    int points_room, skips_room;
    int64_t *directions_udeg; // of one sweep
    struct plan_bench at;     // where the bench stands after the last point
    int skips_for[PLAN_SKIP_REASONS], skips_in[BENCH_KEEP_OUTS];
    struct campaign_channel channels[CAMPAIGN_CHANNELS]; // resolved: of "laser" the bench's
    int channels_count;
};

const char *plan_kind_name(enum plan_kind k)
{
    static const char *const names[] = {"sample", "beam", "dark"};
    return names[k];
}

const char *plan_skip_text(enum plan_skip_reason r)
{
    static const char *const texts[] = {"in the detector's shadow", "beyond an axis's limits",
                                        "in a keep-out", "cut off by a keep-out"};
    return texts[r];
}

void plan_clear(struct plan *p)
{
    if (!p)
        return;
    free(p->points);
    free(p->skips);
    free(p->warnings);
    free(p->steps);
    *p = (struct plan){0};
}

// --- growing lists -------------------------------------------------------------------------------

static void *grow(void *list, int count, int *room, size_t size)
{
    if (count < *room)
        return list;
    int more = *room ? 2 * *room : 256;
    void *larger = realloc(list, (size_t)more * size);
    if (larger)
        *room = more;
    return larger;
}

static int add_point(struct maker *m, const struct plan_point *point, struct gon_error *err)
{
    struct plan *p = &m->plan;
    if (p->count >= PLAN_MOST_POINTS)
        return gon_fail(err, GON_E_INPUT,
                        "more than %d points; make theta_r.step_deg or dense.step_deg larger",
                        PLAN_MOST_POINTS);
    struct plan_point *larger = grow(p->points, p->count, &m->points_room, sizeof *larger);
    if (!larger)
        return gon_fail(err, GON_E_SYSTEM, "plan: out of memory");
    p->points = larger;
    p->points[p->count++] = *point;
    p->samples += point->kind == PLAN_SAMPLE;
    return GON_OK;
}

static int add_skip(struct maker *m, const struct plan_skip *skip, int keep_out,
                    struct gon_error *err)
{
    struct plan *p = &m->plan;
    struct plan_skip *larger = grow(p->skips, p->skips_count, &m->skips_room, sizeof *larger);
    if (!larger)
        return gon_fail(err, GON_E_SYSTEM, "plan: out of memory");
    p->skips = larger;
    p->skips[p->skips_count++] = *skip;
    m->skips_for[skip->reason]++;
    if (keep_out >= 0)
        m->skips_in[keep_out]++;
    return GON_OK;
}

static void warn(struct maker *m, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

static void warn(struct maker *m, const char *fmt, ...)
{
    struct plan *p = &m->plan;
    va_list args;
    if (p->warnings_count == MOST_WARNINGS)
        return;
    va_start(args, fmt);
    vsnprintf(p->warnings[p->warnings_count++], sizeof *p->warnings, fmt, args);
    va_end(args);
}

// --- directions ----------------------------------------------------------------------------------

static int by_value(const void *a, const void *b)
{
    const int64_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

// Steps that fit into a length, its end included despite rounding.
static int steps_in(double length, double step)
{
    return (int)floor(length / step + 1e-9);
}

// Coarse grid and dense zone, rising, each direction once. At most MOST_DIRECTIONS: steps are >=
// 0.01 deg.
static int directions(struct maker *m, double theta_i_deg)
{
    const struct campaign_config *c = m->config;
    const int64_t from = units_udeg(c->from_deg), to = units_udeg(c->to_deg);
    int64_t *list = m->directions_udeg;
    int n = 0, unique = 0;
    for (int k = 0; k <= steps_in(c->to_deg - c->from_deg, c->step_deg); k++)
        list[n++] = units_udeg(c->from_deg + k * c->step_deg);
    const int half =
        c->dense_half_width_deg > 0 ? steps_in(c->dense_half_width_deg, c->dense_step_deg) : -1;
    for (int k = -half; k <= half; k++) {
        int64_t at = units_udeg(theta_i_deg + k * c->dense_step_deg);
        if (at >= from && at <= to)
            list[n++] = at;
    }
    qsort(list, (size_t)n, sizeof *list, by_value);
    for (int k = 0; k < n; k++)
        if (k == 0 || list[k] != list[unique - 1])
            list[unique++] = list[k];
    return unique;
}

static bool in_dense_zone(const struct campaign_config *c, double theta_i_deg, double theta_r_deg)
{
    int64_t off = llabs(units_udeg(theta_r_deg) - units_udeg(theta_i_deg));
    return c->dense_half_width_deg > 0 && off <= units_udeg(c->dense_half_width_deg);
}

static bool in_shadow(const struct campaign_config *c, double theta_i_deg, double theta_r_deg)
{
    return llabs(units_udeg(theta_r_deg) + units_udeg(theta_i_deg)) < units_udeg(c->blind_half_deg);
}

// Whether the point is measured; if so, the bench stands there now. The axes' limits come before
// the shadow.
static bool takes(struct maker *m, double theta_i_deg, double theta_r_deg,
                  enum plan_skip_reason *ret_reason, int *ret_keep_out)
{
    const bool shadow = in_shadow(m->config, theta_i_deg, theta_r_deg);
    const struct plan_bench before = m->at;
    const bool went = plan_bench_go(&m->at, theta_i_deg, theta_r_deg, ret_reason, ret_keep_out);
    if (shadow && (went || *ret_reason != PLAN_SKIP_LIMITS)) {
        m->at = before;
        *ret_reason = PLAN_SKIP_BLIND;
        *ret_keep_out = -1;
        return false;
    }
    return went;
}

// A way that a keep-out cuts off may be open in another state, where the bench comes from
// elsewhere.
static bool listed(const struct plan *p, int sweep, double theta_r_deg)
{
    for (int i = p->skips_count - 1; i >= 0 && p->skips[i].sweep == sweep; i--)
        if (p->skips[i].theta_r_deg == theta_r_deg)
            return true;
    return false;
}

// One state's directions; *point counts on from state to state.
static int add_directions(struct maker *m, int sweep, double theta_i_deg, int n,
                          const struct campaign_channel *channel, int *point, struct gon_error *err)
{
    const struct campaign_config *c = m->config;
    const bool first = channel == m->channels;
    int rc = GON_OK;
    for (int k = 0; k < n && rc >= 0; k++) {
        const double theta_r_deg = units_deg_of_udeg(m->directions_udeg[k]);
        enum plan_skip_reason reason;
        const bool dense = in_dense_zone(c, theta_i_deg, theta_r_deg);
        int keep_out = -1;
        const bool skip = !takes(m, theta_i_deg, theta_r_deg, &reason, &keep_out);
        if (skip && (first || !listed(&m->plan, sweep, theta_r_deg)))
            rc = add_skip(m, &(struct plan_skip){sweep, theta_i_deg, theta_r_deg, reason}, keep_out,
                          err);
        else if (!skip)
            rc = add_point(m,
                           &(struct plan_point){.sweep = sweep,
                                                .point = (*point)++,
                                                .kind = PLAN_SAMPLE,
                                                .theta_i_deg = theta_i_deg,
                                                .theta_r_deg = theta_r_deg,
                                                .pol_in = channel->in,
                                                .pol_out = channel->out,
                                                .weight = dense ? c->dense_weight : 1.0,
                                                .dense = dense},
                           err);
    }
    return rc;
}

static int add_sweep(struct maker *m, int sweep, double theta_i_deg, struct gon_error *err)
{
    const int n = directions(m, theta_i_deg);
    int point = 0, rc = GON_OK;
    for (int i = 0; i < m->channels_count && rc >= 0; i++)
        rc = add_directions(m, sweep, theta_i_deg, n, &m->channels[i], &point, err);
    return rc;
}

// Both references stand at the beam's station, so that nothing moves between them.
static int add_reference(struct maker *m, int sweep, int point, enum plan_kind kind, int pol_in,
                         struct gon_error *err)
{
    struct plan_point p = {.sweep = sweep,
                           .point = point,
                           .kind = kind,
                           .station = "beam",
                           .pol_in = pol_in,
                           .pol_out = plan_beam_out(m->config, m->bench, pol_in),
                           .weight = 1.0};
    const struct bench_station *s = m->bench ? bench_find_station(m->bench, p.station) : NULL;
    if (s) {
        p.theta_i_deg = s->theta_i_deg;
        p.theta_r_deg = s->theta_r_deg;
    }
    int rc = plan_bench_go_station(&m->at, p.station, err);
    return rc < 0 ? rc : add_point(m, &p, err);
}

// States of the light in the order of the channels, each once.
static int states_of_light(const struct maker *m, int states[POL_COUNT])
{
    int n = 0;
    for (int i = 0; i < m->channels_count; i++) {
        int k = 0;
        while (k < n && states[k] != m->channels[i].in)
            k++;
        if (k == n)
            states[n++] = m->channels[i].in;
    }
    return n;
}

static int add_all(struct maker *m, struct gon_error *err)
{
    const struct campaign_config *c = m->config;
    const int last = c->theta_i_count + 1;
    int states[POL_COUNT] = {0}, n = states_of_light(m, states);
    int rc = add_reference(m, 0, 0, PLAN_DARK, states[0], err);
    for (int i = 0; i < n && rc >= 0; i++)
        rc = add_reference(m, 0, 1 + i, PLAN_BEAM, states[i], err);
    for (int i = 0; i < c->theta_i_count && rc >= 0; i++)
        rc = add_sweep(m, i + 1, units_deg_of_udeg(units_udeg(c->theta_i_deg[i])), err);
    for (int i = 0; i < n && rc >= 0; i++)
        rc = add_reference(m, last, i, PLAN_BEAM, states[i], err);
    return rc >= 0 ? add_reference(m, last, n, PLAN_DARK, states[n - 1], err) : rc;
}

// --- warnings ------------------------------------------------------------------------------------

static void warn_of_directions(struct maker *m)
{
    const struct campaign_config *c = m->config;
    const struct plan *p = &m->plan;
    int grazing = 0;
    for (int i = 0; i < p->count; i++)
        grazing +=
            p->points[i].kind == PLAN_SAMPLE && fabs(p->points[i].theta_r_deg) >= GRAZING_DEG;
    for (int i = 0; i < c->theta_i_count; i++) {
        const double t = c->theta_i_deg[i];
        if (in_shadow(c, t, t))
            warn(m,
                 "theta_i = %.9g deg: the specular direction lies in the detector's shadow, "
                 "|theta_r + theta_i| < "
                 "%.9g deg",
                 t, c->blind_half_deg);
        else if (t < c->from_deg || t > c->to_deg)
            warn(m,
                 "theta_i = %.9g deg: the specular direction lies outside theta_r = %.9g..%.9g deg",
                 t, c->from_deg, c->to_deg);
    }
    if (m->skips_for[PLAN_SKIP_LIMITS])
        warn(m, "%d points lie beyond the limits of an axis and are skipped",
             m->skips_for[PLAN_SKIP_LIMITS]);
    for (int i = 0; i < BENCH_KEEP_OUTS; i++)
        if (m->skips_in[i])
            warn(m, "%d points lie in keep-out \"%s\" and are skipped", m->skips_in[i],
                 m->bench->keep_out[i].name);
    if (m->skips_for[PLAN_SKIP_CUT_OFF])
        warn(m,
             "%d points are skipped because a keep-out lies between them and the point before; "
             "order or limit the sweeps so that each stays on one side",
             m->skips_for[PLAN_SKIP_CUT_OFF]);
    if (grazing)
        warn(m, "%d points at |theta_r| >= %g deg: 0.1 deg there changes 1/cos theta_r by 2 %%",
             grazing, GRAZING_DEG);
    if (c->theta_i_count < 3)
        warn(m, "%d angle%s of incidence: a fit of five parameters wants at least 3",
             c->theta_i_count, c->theta_i_count == 1 ? "" : "s");
}

static void warn_of_state(struct maker *m, bool in, int state)
{
    char text[sizeof *m->plan.warnings];
    if (plan_state_warning(m->bench, in, state, text, sizeof text) > 0)
        warn(m, "%s", text);
}

static void warn_of_beam(struct maker *m, int in)
{
    const int out = plan_beam_out(m->config, m->bench, in);
    if (m->bench->polarisation.pol_out.count && out != POL_U)
        warn(m,
             "the analyser cannot be taken out: the beam of pol_in = \"%s\" is measured behind it "
             "at \"%s\", where it passes %g of the light",
             polarisation_name((enum polarisation)in), polarisation_name((enum polarisation)out),
             polarisation_passed((enum polarisation)in, (enum polarisation)out));
}

static void warn_of_polarisation(struct maker *m)
{
    bool seen_in[POL_COUNT] = {false}, seen_out[POL_COUNT] = {false};
    for (int i = 0; m->bench && i < m->channels_count; i++) {
        const struct campaign_channel *c = &m->channels[i];
        if (!seen_in[c->in])
            warn_of_state(m, true, c->in);
        if (!seen_in[c->in])
            warn_of_beam(m, c->in);
        if (!seen_out[c->out])
            warn_of_state(m, false, c->out);
        seen_in[c->in] = seen_out[c->out] = true;
    }
    if (seen_in[POL_UNKNOWN])
        warn(m, "the laser's polarisation is unknown: what is measured is f_00 + m f_01 with "
                "unknown m");
}

// --- time ----------------------------------------------------------------------------------------

// What is left of a step of 1 after x time constants of n equal poles.
static double residual(int n, double x)
{
    double term = 1, sum = 1;
    for (int k = 1; k < n; k++) {
        term *= x / k;
        sum += term;
    }
    return exp(-x) * sum;
}

// Of white noise through n equal poles, x time constants apart (daemon/acquire.h).
static double correlation(int n, double x)
{
    switch (n) {
    case 1:
        return exp(-x);
    case 2:
        return (1 + x) * exp(-x);
    case 3:
        return (1 + x + x * x / 3) * exp(-x);
    default:
        return (1 + x + 2 * x * x / 5 + x * x * x / 15) * exp(-x);
    }
}

static double solve(double (*falling)(int n, double x), int slope_db, double target)
{
    double lo = 0, hi = 100;
    for (int k = 0; k < 60; k++) {
        double x = 0.5 * (lo + hi);
        if (falling(slope_db / 6, x) > target)
            lo = x;
        else
            hi = x;
    }
    return hi;
}

double plan_settle_s(double time_constant_s, int slope_db)
{
    return time_constant_s * solve(residual, slope_db, RESIDUAL);
}

double plan_spacing_s(double time_constant_s, int slope_db)
{
    return time_constant_s * solve(correlation, slope_db, CORRELATION);
}

static int readings_of(const struct campaign_config *c, enum plan_kind kind)
{
    return kind == PLAN_DARK   ? c->dark_readings
           : kind == PLAN_BEAM ? c->beam_readings
                               : c->readings;
}

// The directions' axes move together, after the elements; the sample goes in and out once each way.
// Changes of range are not in it.
static double duration_s(const struct maker *m)
{
    const struct bench_config *b = m->bench;
    if (!b)
        return (double)NAN;
    const double settle = plan_settle_s(b->detector.time_constant_s, b->detector.slope_db);
    const double spacing = plan_spacing_s(b->detector.time_constant_s, b->detector.slope_db);
    double total = b->laser.warmup_s + m->at.moves_s;
    for (int i = 0; i < m->plan.count; i++) {
        const struct plan_point *p = &m->plan.points[i];
        total += i ? plan_states_move_s(b, p - 1, p) : 0;
        total += OVERHEAD_S + settle + spacing * (readings_of(m->config, p->kind) - 1);
    }
    return total;
}

// --- all of it -----------------------------------------------------------------------------------

// Of "laser" what the bench says; the same state twice would be measured twice as one.
static int take_channels(struct maker *m, struct gon_error *err)
{
    m->channels_count = campaign_channels(m->config, m->channels);
    for (int i = 0; i < m->channels_count; i++) {
        struct campaign_channel *c = &m->channels[i];
        if (c->in == POL_IN_LASER && m->bench)
            c->in = m->bench->laser.polarisation;
        for (int k = 0; k < i; k++)
            if (m->channels[k].in == c->in && m->channels[k].out == c->out)
                return gon_fail(err, GON_E_INPUT,
                                "pol_in: \"laser\" is \"%s\" on this bench, which is in the list "
                                "too; each state once",
                                polarisation_name((enum polarisation)c->in));
    }
    return GON_OK;
}

int plan_make(const struct campaign_config *config, const struct bench_config *bench,
              struct plan *ret_plan, struct gon_error *err)
{
    struct maker m = {.config = config, .bench = bench};
    int rc = plan_bench_init(&m.at, bench, err);
    if (rc < 0)
        return rc;
    m.plan.sweeps = config->theta_i_count;
    m.plan.warnings = calloc(MOST_WARNINGS, sizeof *m.plan.warnings);
    m.directions_udeg = calloc(MOST_DIRECTIONS, sizeof *m.directions_udeg);
    rc = m.plan.warnings && m.directions_udeg ? take_channels(&m, err)
                                              : gon_fail(err, GON_E_SYSTEM, "plan: out of memory");
    if (rc >= 0)
        rc = add_all(&m, err);
    free(m.directions_udeg);
    if (rc >= 0)
        rc = plan_add_steps(config, bench, &m.plan, err);
    if (rc >= 0 && m.plan.samples == 0)
        rc = gon_fail(err, GON_E_INPUT, "nothing is left to measure: all %d points are skipped",
                      m.plan.skips_count);
    if (rc < 0) {
        plan_clear(&m.plan);
        return rc;
    }
    warn_of_directions(&m);
    warn_of_polarisation(&m);
    m.plan.duration_s = duration_s(&m);
    if (m.plan.duration_s > LONG_S)
        warn(&m, "it takes about %.0f hours", m.plan.duration_s / 3600);
    *ret_plan = m.plan;
    return GON_OK;
}
