// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "campaign_fixture.h"

#include "base/units.h"
#include "campaign/reduce.h"
#include "fit/rng.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

static bool near(double a, double b, double rel)
{
    return fabs(a - b) <= rel * fabs(b);
}

struct setup {
    struct bench_config bench;
    struct plan plan;
    struct store_reading rows[3000];
    int count;
};

static void start(struct setup *s, const char *campaign)
{
    const struct campaign_config c = fixture_campaign(campaign);
    memset(s, 0, sizeof *s);
    s->bench = fixture_bench();
    assert_int_equal(plan_make(&c, &s->bench, &s->plan, NULL), 0);
}

#define ONE_SWEEP                                                                                  \
    "campaign: { name = \"a\"; theta_i_deg = 30; theta_r: { from_deg = 0; to_deg = 60; step_deg "  \
    "= 60; };"                                                                                     \
    " dense: { half_width_deg = 0; }; };"

static struct store_reading *add(struct setup *s, int sweep, int point, double signal_v,
                                 double monitor_v)
{
    struct store_reading *r = &s->rows[s->count++];
    *r = (struct store_reading){.sweep = sweep,
                                .point = point,
                                .attempt = 1,
                                .signal_v = signal_v,
                                .monitor_v = monitor_v,
                                .count = 4};
    for (int i = 0; i < s->plan.count; i++)
        if (s->plan.points[i].sweep == sweep && s->plan.points[i].point == point) {
            r->theta_i_udeg = (int32_t)units_udeg(s->plan.points[i].theta_i_deg);
            r->theta_r_udeg = (int32_t)units_udeg(s->plan.points[i].theta_r_deg);
        }
    return r;
}

// By hand. Omega = pi (8/500)^2. Dark 0.1 V, monitor dark 0.05 V. Beam (2.1 - 0.1)/(1.05 - 0.05)
// = 2. Point at theta_r = 60: S - D = 0.001 V, M - Dm = 0.5 V: f = 0.002/2 / (Omega cos 60 deg) =
// 0.002/Omega.
static void a_point_is_reduced_as_by_hand(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction r;
    start(&s, ONE_SWEEP);
    add(&s, 0, 0, 0.1, 0.05);
    add(&s, 0, 1, 2.1, 1.05);
    add(&s, 1, 0, 0.102, 1.05);
    add(&s, 1, 1, 0.101, 0.55);
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    const double omega_sr = 3.14159265358979 * 0.016 * 0.016;
    assert_int_equal(r.count, 2);
    assert_true(near(r.omega_sr, omega_sr, 1e-12));
    assert_true(near(r.points[0].f_per_sr, 0.002 / 2 / omega_sr, 1e-9));
    assert_true(near(r.points[1].f_per_sr, 0.002 / omega_sr, 1e-9));
    assert_true(r.points[1].sweep == 1 && r.points[1].point == 1 && r.points[1].theta_r_deg == 60);
    // 2 x 0.004/8 and 2 x 0.25/500; no scatter, one beam reading.
    assert_true(near(r.u_radius_rel, 0.001, 1e-12) && near(r.u_distance_rel, 0.001, 1e-12));
    assert_true(near(r.u_scale_rel, sqrt(2e-6), 1e-9));
    assert_true(near(r.points[1].u_b_per_sr, r.points[1].f_per_sr * sqrt(2e-6), 1e-9));
    assert_true(isnan(r.points[1].u_a_per_sr)); // no sample scattered: unknown, not zero
    reduction_clear(&r);
    plan_clear(&s.plan);
}

static void overfilled_divides_by_the_other_cosine(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction under, over;
    start(&s, ONE_SWEEP);
    add(&s, 0, 0, 0.1, (double)NAN); // and without a monitor
    add(&s, 0, 1, 2.1, (double)NAN);
    add(&s, 1, 1, 0.102, (double)NAN);
    for (int i = 0; i < s.count; i++)
        s.rows[i].monitor_sd_v = (double)NAN;
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &under, NULL), 0);
    s.bench.regime = BENCH_OVERFILLED;
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &over, NULL), 0);
    assert_true(near(under.points[0].f_per_sr, 0.001 / (under.omega_sr * 0.5), 1e-9));
    assert_true(near(over.points[0].f_per_sr, 0.001 / (over.omega_sr * sqrt(0.75)), 1e-9));
    reduction_clear(&under);
    reduction_clear(&over);
    plan_clear(&s.plan);
}

static void angles_are_the_encoders(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction r;
    start(&s, ONE_SWEEP);
    add(&s, 0, 0, 0, 0);
    add(&s, 0, 1, 1, 1);
    add(&s, 1, 1, 0.001, 1)->theta_r_udeg = 61000000;
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_true(near(r.points[0].f_per_sr, 0.001 / (r.omega_sr * cos(units_rad(61))), 1e-9));
    reduction_clear(&r);
    plan_clear(&s.plan);
}

// Opening and closing beam 2 and 2.02: mean 2.01, standard uncertainty of the mean 0.01. Darks 0.0
// and 0.0002 V: 0.0001 V, and their mean 0.0001 V.
static void references_are_averaged_and_their_scatter_counts(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction r;
    start(&s, ONE_SWEEP);
    add(&s, 0, 0, 0, 0);
    add(&s, 0, 1, 2.0001, 1);
    add(&s, 1, 1, 0.0101, 1);
    add(&s, 2, 0, 2.0201, 1);
    add(&s, 2, 1, 0.0002, 0);
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_true(r.beams == 2 && r.darks == 2);
    assert_true(near(r.reference.dark_signal_v, 0.0001, 1e-9) && near(r.u_dark_v, 0.0001, 1e-6));
    assert_true(near(r.u_beam_rel, 0.01 / 2.01, 1e-6));
    assert_true(near(r.points[0].f_per_sr, 0.01 / 2.01 / (r.omega_sr * 0.5), 1e-9));
    assert_true(near(r.u_scale_rel, sqrt(2e-6 + 0.01 / 2.01 * 0.01 / 2.01), 1e-6));
    const struct reduce_reference o = reduce_opening(&s.plan, s.rows, s.count);
    assert_true(o.beam_signal_v[POL_U] == 2.0001 && o.dark_signal_v == 0 &&
                o.beam_monitor_v[POL_U] == 1);
    reduction_clear(&r);
    plan_clear(&s.plan);
}

// Dark and beam go up and down again, linearly in time; the opening references were measured again
// at the top, as their second attempts.
static double dark_at(double t_s)
{
    return 0.10 + 0.06 * (1 - fabs(t_s - 100) / 100);
}

static double beam_at(double t_s)
{
    return 2.0 + 0.2 * (1 - fabs(t_s - 100) / 100);
}

static struct store_reading *add_at(struct setup *s, int sweep, int point, int attempt, double t_s,
                                    double part)
{
    struct store_reading *r = add(s, sweep, point, dark_at(t_s) + part * beam_at(t_s), 1);
    r->t_utc_ms = (int64_t)(t_s * 1000);
    r->attempt = attempt;
    return r;
}

static void after_a_gap_references_are_taken_as_of_their_time(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction r;
    start(&s, ONE_SWEEP);
    add_at(&s, 0, 0, 1, 0, 0)->monitor_v = 0;
    add_at(&s, 0, 0, 2, 100, 0)->monitor_v = 0;
    add_at(&s, 0, 1, 1, 0, 1);
    add_at(&s, 0, 1, 2, 100, 1);
    add_at(&s, 1, 0, 1, 30, 0.01);
    add_at(&s, 1, 1, 1, 170, 0.01);
    add_at(&s, 2, 0, 1, 200, 1);
    add_at(&s, 2, 1, 1, 200, 0)->monitor_v = 0;
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_true(r.beams == 3 && r.darks == 3 && r.count == 2);
    assert_true(near(r.points[0].f_per_sr, 0.01 / r.omega_sr, 1e-9));
    assert_true(near(r.points[1].f_per_sr, 0.01 / (r.omega_sr * 0.5), 1e-9));
    assert_true(near(r.u_dark_v, 0.03, 1e-9)); // half of what neighbours differ by
    assert_true(near(r.u_beam_rel, 0.1 / ((2.0 + 2.2 + 2.0) / 3), 1e-9));
    reduction_clear(&r);

    s.rows[1].flags = s.rows[3].flags = STORE_DISCARDED; // then it is a mean again
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_true(r.beams == 2 && r.darks == 2);
    assert_true(near(r.points[0].f_per_sr, (dark_at(30) - 0.1 + 0.01 * beam_at(30)) / 2 / r.omega_sr,
                     1e-9));
    reduction_clear(&r);

    s.rows[1].flags = s.rows[3].flags = 0;
    s.rows[3].signal_v = 0.1; // one of them without light
    struct gon_error err;
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "is not above the dark"));
    plan_clear(&s.plan);
}

static void only_accepted_readings_are_reduced(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction r;
    struct gon_error err;
    start(&s, ONE_SWEEP);
    add(&s, 0, 0, 0, 0);
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "no beam reading yet"));
    assert_true(isnan(reduce_opening(&s.plan, s.rows, s.count).beam_signal_v[POL_U]));
    add(&s, 0, 1, 1, 1);
    add(&s, 1, 0, 9, 1)->flags = STORE_SATURATED;
    add(&s, 1, 0, 0.5, 1)->attempt = 2;
    add(&s, 1, 1, 9, 1)->flags = STORE_MOVED;
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_int_equal(r.count, 1);
    assert_int_equal(r.points[0].attempt, 2);
    assert_true(near(r.points[0].f_per_sr, 0.5 / r.omega_sr, 1e-9));
    reduction_clear(&r);
    // Light that is gone has no value, and a beam below the dark no scale.
    s.rows[3].monitor_v = 0;
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_true(r.count == 0 && r.left_out == 1);
    reduction_clear(&r);
    s.rows[1].signal_v = -1;
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "not above the dark"));
    plan_clear(&s.plan);
}

// A filter that passes 1 % of the beam, with u 0.5 % of that.
static void a_filter_that_stands_in_the_beam_alone_divides_the_beam(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction r;
    start(&s, ONE_SWEEP);
    struct bench_station *beam = &s.bench.stations[0];
    assert_string_equal(beam->name, "beam");
    beam->places[beam->places_count++] =
        (struct bench_place){"nd", "2", .transmission = 0.01, .u_transmission = 0.00005};
    add(&s, 0, 0, 0, 0);
    add(&s, 0, 1, 1, 1);
    add(&s, 1, 0, 0.5, 1);
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_true(near(r.points[0].f_per_sr, 0.005 / r.omega_sr, 1e-9));
    assert_true(near(r.channel[0].u_filter_rel, 0.005, 1e-9));
    assert_true(near(r.u_scale_rel, hypot(0.005, hypot(r.u_radius_rel, r.u_distance_rel)), 1e-9));
    reduction_clear(&r);
    plan_clear(&s.plan);
}

#define POLARISED(states)                                                                          \
    "campaign: { name = \"a\"; theta_i_deg = 30; theta_r: { from_deg = 0; to_deg = 60; step_deg "  \
    "= "                                                                                           \
    "60; };"                                                                                       \
    " dense: { half_width_deg = 0; }; " states " };"

static void start_polarised(struct setup *s, const char *campaign)
{
    const struct campaign_config c = fixture_campaign(campaign);
    memset(s, 0, sizeof *s);
    s->bench = fixture_polarised_bench();
    assert_int_equal(plan_make(&c, &s->bench, &s->plan, NULL), 0);
}

// Beam of s 2, of p 0.5: each reading goes over its own. Extinction 0.002 of the polariser, over
// sqrt(3), times the other state's f in the same direction; radius and distance sqrt(2e-6).
static void each_state_is_divided_by_its_own_beam(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction r;
    start_polarised(&s, POLARISED("pol_in = (\"s\", \"p\");"));
    add(&s, 0, 0, 0, 0);
    add(&s, 0, 1, 2.0, 1);
    add(&s, 0, 2, 0.5, 1);
    add(&s, 1, 0, 0.004, 1);
    add(&s, 1, 1, 0.002, 1);
    add(&s, 1, 2, 0.003, 1);
    add(&s, 1, 3, 0.001, 1);
    add(&s, 2, 0, 2.0, 1);
    add(&s, 2, 1, 0.5, 1);
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    const double omega_sr = r.omega_sr, u_scale = sqrt(2e-6), u_leak = 0.002 / sqrt(3);
    assert_true(r.count == 4 && r.channels == 2 && r.beams == 4 && r.darks == 1);
    const double f_per_sr[] = {0.002, 0.002, 0.006, 0.004}; // times Omega; 60 deg halves the cosine
    for (int i = 0; i < 4; i++) {
        assert_true(near(r.points[i].f_per_sr, f_per_sr[i] / omega_sr, 1e-9));
        assert_true(r.points[i].pol_in == (i < 2 ? POL_S : POL_P) && r.points[i].pol_out == POL_U);
        assert_true(near(r.points[i].u_b_per_sr,
                         hypot(f_per_sr[i] * u_scale, f_per_sr[(i + 2) % 4] * u_leak) / omega_sr,
                         1e-9));
    }
    assert_true(near(r.u_scale_rel, u_scale, 1e-9) && r.channel[1].u_analyser_rel == 0);
    assert_true(r.reference.beam_signal_v[POL_S] == 2 && r.reference.beam_signal_v[POL_P] == 0.5);
    assert_true(isnan(r.reference.beam_signal_v[POL_U]));
    reduction_clear(&r);
    plan_clear(&s.plan);
}

// T = 0.8 with u 1 %: a reading behind the analyser goes over T, and u(T)/T is in its scale. It was
// s through s: of the crossed one there is no reading, so the leaks count as part of f itself.
static void readings_behind_the_analyser_go_over_its_transmission(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction r;
    start_polarised(&s, POLARISED("pol_in = \"s\"; pol_out = (\"s\", \"u\");"));
    add(&s, 0, 0, 0, 0);
    add(&s, 0, 1, 2.0, 1);
    add(&s, 1, 0, 0.004, 1);
    add(&s, 1, 2, 0.004, 1);
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_true(near(r.points[0].f_per_sr, 0.002 / 0.8 / r.omega_sr, 1e-9));
    assert_true(near(r.points[1].f_per_sr, 0.002 / r.omega_sr, 1e-9));
    assert_true(near(r.channel[0].u_scale_rel, sqrt(2e-6 + 1e-4), 1e-9));
    assert_true(near(r.channel[1].u_scale_rel, sqrt(2e-6), 1e-9));
    assert_true(near(r.u_scale_rel, sqrt(2e-6 + 1e-4), 1e-9)); // the largest
    assert_true(near(r.points[0].u_b_per_sr / r.points[0].f_per_sr,
                     sqrt(2e-6 + 1e-4 + (0.002 * 0.002 + 0.001 * 0.001) / 3), 1e-9));
    reduction_clear(&r);
    plan_clear(&s.plan);
    // An analyser that stays in the beam: T cancels, with its uncertainty; of u light half passes.
    start_polarised(&s, POLARISED("pol_in = \"s\"; pol_out = \"s\";"));
    s.plan.points[1].pol_out = POL_S;
    add(&s, 0, 0, 0, 0);
    add(&s, 0, 1, 2.0, 1);
    add(&s, 1, 0, 0.004, 1);
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_true(near(r.points[0].f_per_sr, 0.002 / r.omega_sr, 1e-9));
    assert_true(near(r.u_scale_rel, sqrt(2e-6), 1e-9));
    reduction_clear(&r);
    for (int i = 0; i < s.plan.count; i++)
        s.plan.points[i].pol_in = POL_U;
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_true(near(r.points[0].f_per_sr, 0.001 / r.omega_sr, 1e-9));
    reduction_clear(&r);
    plan_clear(&s.plan);
}

// Without states in the bench's file the operator's analyser stood in the beam too: as ever.
static void an_operators_analyser_is_not_reckoned_with(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction r;
    start(&s, POLARISED("pol_out = \"s\";"));
    add(&s, 0, 0, 0, 0);
    add(&s, 0, 1, 2.0, 1);
    add(&s, 1, 0, 0.004, 1);
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    assert_true(near(r.points[0].f_per_sr, 0.002 / r.omega_sr, 1e-9));
    assert_true(r.points[0].pol_in == POL_U && r.points[0].pol_out == POL_S);
    reduction_clear(&r);
    plan_clear(&s.plan);
}

static void a_state_without_its_beam_is_refused(void **state)
{
    (void)state;
    static struct setup s;
    struct reduction r;
    struct gon_error err;
    start_polarised(&s, POLARISED("pol_in = (\"s\", \"p\");"));
    add(&s, 0, 0, 0, 0);
    add(&s, 0, 1, 2.0, 1);
    add(&s, 1, 0, 0.004, 1);
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "no beam reading yet of pol_in = \"p\""));
    plan_clear(&s.plan);
}

static void sampled(struct store_reading *r, double value_v, double sd_v, int count, struct rng *g)
{
    double sum = 0, sum2 = 0;
    for (int i = 0; i < count; i++) {
        const double x = sd_v * rng_normal(g);
        sum += x;
        sum2 += x * x;
    }
    r->count = count;
    r->signal_v = value_v + sum / count;
    r->signal_sd_v = sqrt(fmax(0, (sum2 - sum * sum / count) / (count - 1)));
}

#define PAPER_LIKE                                                                                 \
    "campaign: { name = \"a\"; theta_i_deg = (0, 5, 10, 20, 30, 40, 45, 50, 55, 60); };"

// 850 points of 4 samples: three degrees of freedom each, 2550 in all. Signals from 1e-4 to 1e-2 V,
// floor 2e-6 V, relative 5e-4. The estimates' own sd is 2 to 3 %; 5 sd (15 %) are exceeded once in
// a million runs.
static void the_noise_model_finds_floor_and_relative_part(void **state)
{
    (void)state;
    static struct setup s;
    const double floor_v = 2e-6, rel = 5e-4;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct rng g;
        rng_seed(&g, seed);
        start(&s, PAPER_LIKE);
        for (int i = 0; i < s.plan.count; i++) {
            const struct plan_point *p = &s.plan.points[i];
            const double value_v = p->kind == PLAN_DARK   ? 0
                                   : p->kind == PLAN_BEAM ? 0.5
                                                          : pow(10, -4 + 2 * rng_uniform(&g));
            struct store_reading *r = add(&s, p->sweep, p->point, 0, p->kind == PLAN_DARK ? 0 : 1);
            sampled(r, value_v, hypot(floor_v, rel * value_v), p->kind == PLAN_SAMPLE ? 4 : 16, &g);
            r->monitor_sd_v = p->kind == PLAN_DARK ? 0 : 1e-3;
        }
        const struct reduce_noise n = reduce_noise_of(&s.plan, s.rows, s.count);
        assert_true(near(n.floor_v, floor_v, 0.15));
        assert_true(near(n.rel, rel, 0.15));
        assert_true(near(n.rel_monitor, 1e-3, 1e-9));
        plan_clear(&s.plan);
    }
}

// As on a bench: the strongest sample is three decades below the beam, and weak ones are all floor,
// so that the relative part shows in two beam readings only (30 degrees of freedom: its sd is 13 %;
// 5 sd).
static void the_beam_alone_tells_the_relative_part(void **state)
{
    (void)state;
    static struct setup s;
    const double floor_v = 4.3e-8, rel = 1e-4;
    for (uint64_t seed = 1; seed <= 20; seed++) {
        struct rng g;
        rng_seed(&g, seed);
        start(&s, PAPER_LIKE);
        for (int i = 0; i < s.plan.count; i++) {
            const struct plan_point *p = &s.plan.points[i];
            const double value_v = p->kind == PLAN_DARK   ? 2e-7
                                   : p->kind == PLAN_BEAM ? 0.8
                                                          : pow(10, -6 + 2.4 * rng_uniform(&g));
            sampled(add(&s, p->sweep, p->point, 0, 1), value_v, hypot(floor_v, rel * value_v),
                    p->kind == PLAN_SAMPLE ? 4 : 16, &g);
        }
        const struct reduce_noise n = reduce_noise_of(&s.plan, s.rows, s.count);
        assert_true(near(n.floor_v, floor_v, 0.1));
        assert_true(near(n.rel, rel, 0.65));
        plan_clear(&s.plan);
    }
}

// Pure floor: the relative part must come out as nothing, not as a negative variance.
static void a_pure_floor_has_no_relative_part(void **state)
{
    (void)state;
    static struct setup s;
    struct rng g;
    rng_seed(&g, 7);
    start(&s, PAPER_LIKE);
    for (int i = 0; i < s.plan.count; i++) {
        const struct plan_point *p = &s.plan.points[i];
        const double value_v = p->kind == PLAN_DARK ? 0 : 1e-3 * rng_uniform(&g);
        sampled(add(&s, p->sweep, p->point, 0, 1), value_v, 3e-6, 4, &g);
    }
    const struct reduce_noise n = reduce_noise_of(&s.plan, s.rows, s.count);
    assert_true(near(n.floor_v, 3e-6, 0.1));
    assert_true(n.rel >= 0 && n.rel * 1e-3 < 1.5e-6);
    plan_clear(&s.plan);
}

// Reduced values scatter about the truth as their u_A says: chi^2 of 850 points per degree of
// freedom has sd sqrt(2/850) = 0.049 and the noise model's error adds 0.03; 5 sd. The mean u_A of
// single readings with their own scatter would give 3 (Student's t with three degrees of freedom).
static void u_a_is_the_scatter_of_the_reduced_values(void **state)
{
    (void)state;
    static struct setup s;
    struct rng g;
    rng_seed(&g, 11);
    struct reduction r;
    double chi2 = 0;
    start(&s, PAPER_LIKE);
    for (int i = 0; i < s.plan.count; i++) {
        const struct plan_point *p = &s.plan.points[i];
        const double value_v = p->kind == PLAN_DARK   ? 0
                               : p->kind == PLAN_BEAM ? 1
                                                      : 1e-3 * cos(units_rad(p->theta_r_deg));
        struct store_reading *row = add(&s, p->sweep, p->point, 0, p->kind == PLAN_DARK ? 0 : 1);
        if (p->kind == PLAN_BEAM) { // exact: what is tested is type A
            row->signal_v = value_v;
            row->count = 1;
        } else {
            sampled(row, value_v, hypot(2e-7, 1e-3 * value_v), p->kind == PLAN_SAMPLE ? 4 : 1000,
                    &g);
        }
    }
    assert_int_equal(reduce_run(&s.bench, &s.plan, s.rows, s.count, &r, NULL), 0);
    const double truth = 1e-3 / r.omega_sr;
    for (int i = 0; i < r.count; i++) {
        const double off = (r.points[i].f_per_sr - truth) / r.points[i].u_a_per_sr;
        chi2 += off * off;
    }
    assert_int_equal(r.count, 850);
    assert_true(fabs(chi2 / r.count - 1) < 0.3);
    reduction_clear(&r);
    plan_clear(&s.plan);
}

static void a_laser_of_unknown_polarisation_is_said(void **state)
{
    (void)state;
    char text[200];
    struct reduction r = {.polarisation = POL_S};
    assert_int_equal(reduction_warning(&r, text, sizeof text), 0); // the fit knows what to do
    r.polarisation = POL_UNKNOWN;
    reduction_warning(&r, text, sizeof text);
    assert_non_null(strstr(text, "is unknown"));
    r.polarisation = POL_U;
    assert_int_equal(reduction_warning(&r, text, sizeof text), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_is_reduced_as_by_hand),
        cmocka_unit_test(overfilled_divides_by_the_other_cosine),
        cmocka_unit_test(angles_are_the_encoders),
        cmocka_unit_test(references_are_averaged_and_their_scatter_counts),
        cmocka_unit_test(after_a_gap_references_are_taken_as_of_their_time),
        cmocka_unit_test(only_accepted_readings_are_reduced),
        cmocka_unit_test(a_filter_that_stands_in_the_beam_alone_divides_the_beam),
        cmocka_unit_test(each_state_is_divided_by_its_own_beam),
        cmocka_unit_test(readings_behind_the_analyser_go_over_its_transmission),
        cmocka_unit_test(an_operators_analyser_is_not_reckoned_with),
        cmocka_unit_test(a_state_without_its_beam_is_refused),
        cmocka_unit_test(the_noise_model_finds_floor_and_relative_part),
        cmocka_unit_test(the_beam_alone_tells_the_relative_part),
        cmocka_unit_test(a_pure_floor_has_no_relative_part),
        cmocka_unit_test(u_a_is_the_scatter_of_the_reduced_values),
        cmocka_unit_test(a_laser_of_unknown_polarisation_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
