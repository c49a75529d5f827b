// SPDX-License-Identifier: MIT
// uses: sim model base
// The simulated world without its instruments. Statistical checks run on fixed seeds; their bounds
// are five standard deviations, which another seed would break once in 1.7 million.
#include "sim/world.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <string.h>

#define S(s) ((int64_t)((s)*1e9))
#define PI 3.14159265358979323846

static void near(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance))
        fail_msg("%.12g is not %.12g within %.3g", value, expected, tolerance);
}

static void numbers_have_the_moments_of_a_normal_distribution(void **state)
{
    (void)state;
    struct noise n;
    double sum = 0, sum2 = 0, sum4 = 0, u = 0;
    enum { N = 200000 };
    noise_init(&n, 7, 0);
    for (int i = 0; i < N; i++) {
        double x = noise_normal(&n);
        sum += x;
        sum2 += x * x;
        sum4 += x * x * x * x;
        u += noise_uniform(&n);
    }
    near(sum / N, 0, 5 / sqrt(N));
    near(sum2 / N, 1, 5 * sqrt(2.0 / N));
    near(sum4 / N, 3, 5 * sqrt(96.0 / N));
    near(u / N, 0.5, 5 * sqrt(1 / 12.0 / N));
}

static void streams_and_seeds_differ_and_repeat(void **state)
{
    (void)state;
    struct noise a, b, c, d;
    noise_init(&a, 1, 0);
    noise_init(&b, 1, 0);
    noise_init(&c, 1, 1);
    noise_init(&d, 2, 0);
    uint64_t x = noise_bits(&a);
    assert_true(x == noise_bits(&b));
    assert_true(x != noise_bits(&c));
    assert_true(x != noise_bits(&d));
}

// --- motion --------------------------------------------------------------------------------------

static struct motion an_axis(double backlash)
{
    struct motion m;
    motion_init(&m, -100, 100, backlash, 0);
    return m;
}

static void a_long_move_takes_cruise_and_two_ramps(void **state)
{
    (void)state;
    struct motion m = an_axis(0);
    motion_go(&m, 50, 20, 40, 80,
              S(1)); // 0.5 s and 5 deg up, 0.25 s and 2.5 deg down, 42.5 deg at 20
    near(motion_left_s(&m, S(1)), 0.5 + 42.5 / 20 + 0.25, 1e-12);
    near(motion_at(&m, S(1.25)).motor, 0.5 * 40 * 0.25 * 0.25, 1e-9);
    near(motion_at(&m, S(1.25)).speed, 10, 1e-9);
    near(motion_at(&m, S(2.5)).motor, 5 + 20, 1e-9);
    assert_true(motion_at(&m, S(3.874)).moving);
    assert_false(motion_at(&m, S(3.876)).moving);
    assert_true(motion_at(&m, S(3.876)).motor == 50); // exactly
}

static void a_short_move_is_a_triangle(void **state)
{
    (void)state;
    struct motion m = an_axis(0);
    motion_go(&m, -0.4, 20, 40, 40, 0); // peak sqrt(0.4 * 40) = 4
    near(motion_left_s(&m, 0), 2 * 4 / 40.0, 1e-12);
    near(motion_at(&m, S(0.1)).speed, -4, 1e-9);
    near(motion_at(&m, S(0.1)).motor, -0.2, 1e-9);
    assert_true(motion_at(&m, S(0.2001)).motor == -0.4);
}

static void a_new_target_behind_is_reached_by_stopping_and_coming_back(void **state)
{
    (void)state;
    struct motion m = an_axis(0);
    motion_go(&m, 50, 20, 40, 40, 0);
    motion_go(&m, 2, 20, 40, 40, S(0.5)); // at 5 deg with 20 deg/s: stops at 10 deg
    near(motion_at(&m, S(0.5)).speed, 20, 1e-9);
    near(motion_at(&m, S(1)).motor, 10, 1e-9);
    near(motion_at(&m, S(1)).speed, 0, 1e-9);
    assert_true(motion_at(&m, S(1.1)).speed < 0);
    assert_true(motion_at(&m, S(3)).motor == 2);
}

static void a_new_target_ahead_goes_on_from_the_present_speed(void **state)
{
    (void)state;
    struct motion m = an_axis(0);
    motion_go(&m, 10, 20, 40, 40, 0);
    motion_go(&m, 60, 20, 40, 40, S(0.4)); // 16 deg/s, 3.2 deg
    near(motion_at(&m, S(0.4)).speed, 16, 1e-9);
    near(motion_at(&m, S(0.5)).speed, 20, 1e-9);
    near(motion_at(&m, S(1.5)).motor, 25, 1e-9);
    assert_true(motion_at(&m, S(9)).motor == 60);
}

static void a_stop_in_mid_move_ramps_down(void **state)
{
    (void)state;
    struct motion m = an_axis(0);
    motion_go(&m, 50, 20, 40, 40, 0);
    motion_stop(&m, 80, S(1)); // 15 deg, 20 deg/s: 0.25 s, 2.5 deg
    near(motion_left_s(&m, S(1)), 0.25, 1e-12);
    near(motion_at(&m, S(2)).motor, 17.5, 1e-9);
    assert_false(motion_at(&m, S(2)).moving);
}

static void the_load_lags_by_the_backlash_after_a_reversal(void **state)
{
    (void)state;
    struct motion m = an_axis(0.02);
    motion_go(&m, 1, 20, 40, 40, 0);
    near(motion_at(&m, S(9)).load, 1, 1e-12); // upwards the scale is right
    motion_go(&m, 0.99, 20, 40, 40, S(10));
    near(motion_at(&m, S(19)).motor, 0.99, 1e-12);
    near(motion_at(&m, S(19)).load, 1, 1e-12); // not taken up yet
    motion_go(&m, 0.5, 20, 40, 40, S(20));
    near(motion_at(&m, S(29)).load, 0.52, 1e-12);
    motion_go(&m, 0.6, 20, 40, 40, S(30));
    near(motion_at(&m, S(39)).load, 0.6, 1e-12);
}

static void the_load_lags_within_one_plan_that_turns_round(void **state)
{
    (void)state;
    struct motion m = an_axis(0.02);
    motion_go(&m, 50, 20, 40, 40, 0);
    motion_go(&m, 2, 20, 40, 40, S(0.5)); // up to 10, back to 2
    near(motion_at(&m, S(9)).load, 2.02, 1e-9);
}

static void a_hard_limit_stops_the_motor_there(void **state)
{
    (void)state;
    struct motion m = an_axis(0);
    motion_go(&m, 120, 20, 40, 40, 0);
    assert_int_equal(motion_at(&m, S(3)).limit, 0);
    struct motion_state s = motion_at(&m, S(60));
    assert_int_equal(s.limit, 1);
    assert_true(s.motor == 100 && !s.moving && s.speed == 0);
}

// --- laser ---------------------------------------------------------------------------------------

static struct sim_laser a_laser(void)
{
    struct sim_laser l;
    struct sim_laser_spec spec = {
        .power_max_w = 0.1, .power_w = 0.05, .temperatures_s = 20, .warmup_s = 80};
    sim_laser_init(&l, &spec, 1, 0);
    return l;
}

static void the_laser_goes_through_its_states(void **state)
{
    (void)state;
    struct sim_laser l = a_laser();
    assert_int_equal(sim_laser_start(&l, true), SIM_LASER_ACCEPTED);
    sim_laser_step(&l, S(19.9));
    assert_int_equal(l.state, SIM_LASER_TEMPERATURES);
    assert_true(sim_laser_power_w(&l) == 0);
    sim_laser_step(&l, S(30)); // one tau after the light came
    assert_int_equal(l.state, SIM_LASER_WARMING);
    near(sim_laser_power_w(&l), 0.05 * (1 - exp(-1)), 1e-12);
    assert_true(l.emission_since_ns == S(20));
    sim_laser_step(&l, S(99.9));
    assert_int_equal(l.state, SIM_LASER_WARMING);
    sim_laser_step(&l, S(100.1));
    assert_int_equal(l.state, SIM_LASER_COMPLETED);
    near(sim_laser_power_w(&l), 0.05, 0.05 * 4e-4);
}

static void one_long_step_is_the_same_as_many(void **state)
{
    (void)state;
    struct sim_laser a = a_laser(), b = a_laser();
    sim_laser_start(&a, true);
    sim_laser_start(&b, true);
    sim_laser_step(&a, S(57));
    for (int i = 1; i <= 570; i++)
        sim_laser_step(&b, S(0.1) * i);
    near(sim_laser_power_w(&a), sim_laser_power_w(&b), 1e-12);
    assert_int_equal(a.state, b.state);
}

static void a_warm_laser_warms_up_sooner(void **state)
{
    (void)state;
    struct sim_laser l = a_laser();
    sim_laser_start(&l, true);
    sim_laser_step(&l, S(200));
    sim_laser_off(&l);
    assert_true(sim_laser_power_w(&l) == 0 && l.last_off_ns == S(200));
    sim_laser_step(&l, S(204)); // a tenth of its cooling time
    sim_laser_start(&l, true);
    near(sim_laser_power_w(&l), 0.05 * exp(-0.1), 0.05 * 4e-4);
}

static void an_open_interlock_ends_emission_and_asks_for_the_key(void **state)
{
    (void)state;
    struct sim_laser l = a_laser();
    sim_laser_start(&l, true);
    sim_laser_step(&l, S(50));
    sim_laser_set_interlock(&l, false);
    assert_false(sim_laser_emits(&l));
    assert_int_equal(l.fault, 3);
    assert_int_equal(sim_laser_start(&l, true), SIM_LASER_INTERLOCK);
    sim_laser_set_interlock(&l, true);
    assert_int_equal(sim_laser_start(&l, true), SIM_LASER_FAULTY);
    sim_laser_clear_fault(&l);
    assert_int_equal(sim_laser_start(&l, true), SIM_LASER_ACCEPTED);
    sim_laser_step(&l, S(60));
    assert_int_equal(l.state, SIM_LASER_KEY); // waits
    sim_laser_set_key(&l, false);
    sim_laser_set_key(&l, true);
    assert_true(sim_laser_emits(&l));
}

// --- optics --------------------------------------------------------------------------------------

static double detected(double theta_i, double theta_r, double sample_mm)
{
    struct world_spec w;
    world_defaults(&w);
    struct optics_scene s = {theta_i, theta_r, sample_mm, 0.05, NULL};
    return optics_detected_w(&w.optics, &s);
}

static void a_lambertian_sample_gives_the_textbook_power(void **state)
{
    (void)state;
    struct world_spec w;
    world_defaults(&w);
    w.optics.sample.ks = 0;
    w.optics.sample.kd = 0.5;
    w.optics.diffuse = BRDF_DIFFUSE_LAMBERT;
    struct optics_scene s = {30, -60, 0, 0.05, NULL};
    double omega = PI * 8 * 8 / (500.0 * 500.0);
    near(optics_solid_angle_sr(&w.optics), omega, 1e-15);
    near(optics_detected_w(&w.optics, &s), 0.05 * 0.5 / PI * omega * 0.5, 1e-15);
}

static void positive_theta_r_is_the_specular_side(void **state)
{
    (void)state;
    assert_true(detected(45, 45, 0) > 2 * detected(45, -45, 0));
    near(detected(-30, -30, 0), detected(30, 30, 0), 1e-18); // turned over as a whole
}

static void the_beam_is_where_it_should_be_and_nowhere_else(void **state)
{
    (void)state;
    assert_true(detected(0, 180, 30) == 0.05);
    assert_true(detected(0, -180, 30) == 0.05); // the same place
    assert_true(detected(20, 160, 30) == 0.05);
    assert_true(detected(20, 160.8, 30) == 0.05);    // flat within 0.917 - 0.05 deg
    near(detected(20, 160.9167, 30), 0.025, 0.0005); // half way down the edge
    assert_true(detected(20, 160.97, 30) == 0);
    assert_true(detected(20, 159.03, 30) == 0);
    assert_true(detected(20, 160, 0) == 0);  // the sample is in the way
    assert_true(detected(20, 160, 15) == 0); // so is its holder
    assert_true(detected(20, 20, 30) == 0);  // nothing to scatter
    assert_true(detected(20, 120, 0) == 0);  // behind the sample
    assert_true(detected(20, 89.9, 0) > 0);
    assert_true(detected(20, 90, 0) == 0);
}

static void a_term_that_is_off_adds_nothing(void **state)
{
    (void)state;
    struct world_spec w;
    world_defaults(&w);
    struct optics_scene s = {20, 160, 30, 0.05, NULL};
    w.optics.off = 1u << optics_term("beam");
    assert_true(optics_detected_w(&w.optics, &s) == 0);
    assert_int_equal(optics_term("ghost"), -1);
}

// --- lock-in -------------------------------------------------------------------------------------

// Times t in time constants until the residual of a step, e^-t (1 + t + ... + t^(n-1)/(n-1)!) after
// n equal RC poles, is 1e-2 .. 1e-6, to 0.05.
static const double settle_tc[4][5] = {{4.6, 6.9, 9.2, 11.5, 13.8},
                                       {6.6, 9.2, 11.8, 14.2, 16.7},
                                       {8.4, 11.2, 13.9, 16.6, 19.1},
                                       {10.0, 13.1, 15.9, 18.7, 21.4}};

static double residual(int poles, double t_tc)
{
    struct lockin l;
    lockin_init(&l, 0, 1);
    l.poles = poles;
    l.x[0] = l.x[1] = l.x[2] = l.x[3] = 1;
    double steps = ceil(t_tc * 8);
    for (int i = 0; i < steps; i++)
        lockin_step(&l, 0, t_tc / steps * l.time_constant_s);
    return l.x[poles - 1];
}

static void the_filter_settles_as_n_poles_do(void **state)
{
    (void)state;
    for (int p = 0; p < 4; p++)
        for (int i = 0; i < 5; i++) {
            double level = pow(10, -2 - i);
            assert_true(residual(p + 1, settle_tc[p][i] + 0.06) < level);
            assert_true(residual(p + 1, settle_tc[p][i] - 0.06) > level);
        }
}

static void noise_is_as_strong_and_as_correlated_as_theory_says(void **state)
{
    (void)state;
    enum { N = 60000 };
    static const double bandwidth_tc[4] = {1 / 4.0, 1 / 8.0, 3 / 32.0, 5 / 64.0}; // times 1/TC
    for (int p = 0; p < 4; p++) {
        struct lockin l;
        double sum2 = 0, lag = 0, before = 0, x = 1; // samples one time constant apart
        const double expected[4] = {exp(-x), (1 + x) * exp(-x), (1 + x + x * x / 3) * exp(-x),
                                    (1 + x + 0.4 * x * x + x * x * x / 15) * exp(-x)};
        lockin_init(&l, 4e-9, 11);
        l.time_constant_s = 1e-3;
        l.poles = p + 1;
        for (int i = -50; i < N; i++) {
            for (int k = 0; k < 8; k++)
                lockin_step(&l, 0, l.time_constant_s / 8);
            double v = l.x[p];
            if (i >= 0) {
                sum2 += v * v;
                lag += v * before;
            }
            before = v;
        }
        double variance = 16e-18 * bandwidth_tc[p] / 1e-3;
        // Correlated samples count for fewer: with sum over lags of rho^2 below 2.5, sd < sqrt(2 *
        // 6 / N).
        near(sum2 / N / variance, 1, 5 * sqrt(12.0 / N));
        near(lag / sum2, expected[p], 5 * sqrt(6.0 / N));
    }
}

static void noise_does_not_depend_on_how_often_one_looks(void **state)
{
    (void)state;
    enum { N = 20000 };
    double sum2[2] = {0, 0};
    for (int often = 0; often < 2; often++) {
        struct lockin l;
        lockin_init(&l, 4e-9, 5);
        l.time_constant_s = 1e-3;
        for (int i = 0; i < N; i++) {
            for (int k = 0; k < (often ? 40 : 8); k++)
                lockin_step(&l, 0, 1e-3 / (often ? 40 : 8));
            sum2[often] += l.x[1] * l.x[1];
        }
    }
    near(sum2[1] / sum2[0], 1, 5 * sqrt(2 * 12.0 / N));
}

static void overloads_are_remembered_and_outputs_clipped(void **state)
{
    (void)state;
    struct lockin l;
    lockin_init(&l, 0, 1);
    l.full_scale_v = 1e-3;
    for (int i = 0; i < 200; i++)
        lockin_step(&l, 1.0e-3, l.time_constant_s / 8);
    assert_int_equal(l.condition, 0);
    near(lockin_x_v(&l), 1e-3, 1e-3 / 65536);
    for (int i = 0; i < 200; i++)
        lockin_step(&l, 2e-3, l.time_constant_s / 8);
    assert_int_equal(l.condition, LOCKIN_OUTPUT_OVERLOAD);
    near(lockin_x_v(&l), 1.09e-3, 1e-3 / 65536);
    lockin_step(&l, 0.5, l.time_constant_s / 8); // 500 times full scale, normal reserve is 100
    assert_true(l.condition & LOCKIN_INPUT_OVERLOAD);
}

static void the_phase_turns_x_into_y(void **state)
{
    (void)state;
    struct lockin l;
    lockin_init(&l, 0, 1);
    l.phase_rad = PI / 6;
    for (int i = 0; i < 400; i++)
        lockin_step(&l, 0.5, l.time_constant_s / 8);
    near(lockin_x_v(&l), 0.5 * cos(PI / 6), 2e-5);
    near(lockin_y_v(&l), -0.25, 2e-5);
}

// --- the whole world -----------------------------------------------------------------------------

static void put(struct world *w, double theta_i, double theta_r, double sample_mm)
{
    motion_init(&w->axis[WORLD_THETA_I], -10, 95, 0, theta_i);
    motion_init(&w->axis[WORLD_THETA_R], -185, 185, 0, theta_r);
    motion_init(&w->axis[WORLD_SAMPLE], -2, 35, 0, sample_mm);
}

static struct world a_bright_world(uint64_t seed)
{
    struct world_spec spec;
    struct world w;
    world_defaults(&spec);
    spec.seed = seed;
    spec.laser.temperatures_s = 0;
    spec.laser.warmup_s = 1;
    world_init(&w, &spec, 0);
    w.laser.setpoint_w = 0.05;
    w.lockin.time_constant_s = 1e-3;
    sim_laser_start(&w.laser, true);
    put(&w, 45, -45, 0);
    world_see(&w, S(10));
    return w;
}

static void the_beam_fits_the_largest_range_and_scatter_stands_out_of_the_noise(void **state)
{
    (void)state;
    enum { N = 400 };
    struct world w = a_bright_world(3);
    put(&w, 0, 180, 30);
    world_see(&w, S(11));
    assert_true(lockin_x_v(&w.lockin) > 0.5 && lockin_x_v(&w.lockin) < 0.95);
    put(&w, 45, -45, 0);
    double f = optics_f_per_sr(&w.spec.optics, 45, -45);
    near(f, 0.05 / cos(PI / 4), 0.02); // diffuse, a little of the lobe
    world_see(&w, S(11.9));            // down from the beam before the range goes down
    w.lockin.full_scale_v = 5e-5;
    w.lockin.condition = 0;
    double sum = 0, sum2 = 0;
    for (int i = 0; i < N; i++) {
        world_see(&w, S(12) + S(0.01) * i);
        double v = lockin_x_v(&w.lockin);
        sum += v;
        sum2 += v * v;
    }
    double mean = sum / N, sd = sqrt(sum2 / N - mean * mean);
    assert_true(mean * 0.05 / f > 300 * sd); // a reading at 0.05 per sr
    near(mean, 16 * 0.05 * f * optics_solid_angle_sr(&w.spec.optics) * cos(PI / 4) + 2e-7,
         0.02 * mean);
    assert_int_equal(w.lockin.condition, 0);
}

static void looking_late_or_often_shows_the_same_light(void **state)
{
    (void)state;
    struct world a = a_bright_world(3), b = a_bright_world(3);
    a.lockin.noise_v_per_rthz = b.lockin.noise_v_per_rthz = 0;
    a.laser.rin.rms = b.laser.rin.rms = a.laser.drift.rms = b.laser.drift.rms = 0;
    a.laser.rin.value = b.laser.rin.value = a.laser.drift.value = b.laser.drift.value = 0;
    motion_go(&a.axis[WORLD_THETA_R], 45, 300, 60000, 60000, S(10));
    motion_go(&b.axis[WORLD_THETA_R], 45, 300, 60000, 60000, S(10));
    world_see(&a, S(10.2503)); // in mid-move, near 30 deg: the lobe's flank
    for (int i = 1; i <= 2503; i++)
        world_see(&b, S(10) + S(0.0001) * i);
    // Steps of 1/8 TC against shorter ones: the signal climbs within them.
    near(a.lockin.x[1], b.lockin.x[1], 1e-4 * b.lockin.x[1]);
    assert_true(fabs(b.lockin.x[1] / world_input_v(&b, S(10.2503)) - 1) >
                1e-3); // it lags behind the input
    world_see(&a, S(11));
    world_see(&b, S(11));
    near(a.lockin.x[1], b.lockin.x[1], 1e-12);
}

static void the_light_of_a_bench_at_rest_follows_every_change(void **state)
{
    (void)state;
    struct world w = a_bright_world(3);
    double bright = world_input_v(&w, S(11));
    assert_true(bright > 1e-5 && world_input_v(&w, S(12)) == bright);
    w.spec.optics.off = 1u << optics_term("scatter");
    assert_true(world_input_v(&w, S(12)) == w.spec.offset_v);
    w.spec.optics.off = 0;
    assert_true(world_input_v(&w, S(12)) == bright);
    motion_go(&w.axis[WORLD_THETA_R], -44, 20, 60, 60, S(13));
    assert_true(world_input_v(&w, S(13.2)) != bright);
    double after = world_input_v(&w, S(20));
    assert_true(after != bright && world_input_v(&w, S(21)) == after);
    motion_go(&w.axis[WORLD_THETA_R], -45, 20, 60, 60, S(22));
    near(world_input_v(&w, S(30)), bright, 1e-9 * bright);
}

static void the_same_seed_is_the_same_world(void **state)
{
    (void)state;
    struct world a = a_bright_world(3), b = a_bright_world(3), c = a_bright_world(4);
    for (int i = 0; i < 100; i++) {
        world_see(&a, S(11) + i * 777777);
        world_see(&b, S(11) + i * 777777);
        world_see(&c, S(11) + i * 777777);
    }
    assert_true(a.lockin.x[1] == b.lockin.x[1]);
    assert_true(world_aux_v(&a, 1) == world_aux_v(&b, 1));
    assert_true(a.lockin.x[1] != c.lockin.x[1]);
}

static void the_monitor_follows_the_power_in_steps_of_a_third_of_a_millivolt(void **state)
{
    (void)state;
    struct world w = a_bright_world(3);
    double v = world_aux_v(&w, 1);
    near(v, 0.002 + 40 * sim_laser_power_w(&w.laser), 5 * 2e-4 + 1 / 6000.0);
    near(v * 3000, rint(v * 3000), 1e-9);
    assert_true(fabs(world_aux_v(&w, 2)) < 0.002);
}

static void a_long_sleep_costs_no_more_than_sixty_time_constants(void **state)
{
    (void)state;
    struct world w = a_bright_world(3);
    uint64_t before = w.lockin.noise.count;
    world_see(&w, S(100000));
    assert_true(w.lockin.noise.count - before <= 2 * (60 * 8 + 1));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_have_the_moments_of_a_normal_distribution),
        cmocka_unit_test(streams_and_seeds_differ_and_repeat),
        cmocka_unit_test(a_long_move_takes_cruise_and_two_ramps),
        cmocka_unit_test(a_short_move_is_a_triangle),
        cmocka_unit_test(a_new_target_behind_is_reached_by_stopping_and_coming_back),
        cmocka_unit_test(a_new_target_ahead_goes_on_from_the_present_speed),
        cmocka_unit_test(a_stop_in_mid_move_ramps_down),
        cmocka_unit_test(the_load_lags_by_the_backlash_after_a_reversal),
        cmocka_unit_test(the_load_lags_within_one_plan_that_turns_round),
        cmocka_unit_test(a_hard_limit_stops_the_motor_there),
        cmocka_unit_test(the_laser_goes_through_its_states),
        cmocka_unit_test(one_long_step_is_the_same_as_many),
        cmocka_unit_test(a_warm_laser_warms_up_sooner),
        cmocka_unit_test(an_open_interlock_ends_emission_and_asks_for_the_key),
        cmocka_unit_test(a_lambertian_sample_gives_the_textbook_power),
        cmocka_unit_test(positive_theta_r_is_the_specular_side),
        cmocka_unit_test(the_beam_is_where_it_should_be_and_nowhere_else),
        cmocka_unit_test(a_term_that_is_off_adds_nothing),
        cmocka_unit_test(the_filter_settles_as_n_poles_do),
        cmocka_unit_test(noise_is_as_strong_and_as_correlated_as_theory_says),
        cmocka_unit_test(noise_does_not_depend_on_how_often_one_looks),
        cmocka_unit_test(overloads_are_remembered_and_outputs_clipped),
        cmocka_unit_test(the_phase_turns_x_into_y),
        cmocka_unit_test(the_beam_fits_the_largest_range_and_scatter_stands_out_of_the_noise),
        cmocka_unit_test(looking_late_or_often_shows_the_same_light),
        cmocka_unit_test(the_light_of_a_bench_at_rest_follows_every_change),
        cmocka_unit_test(the_same_seed_is_the_same_world),
        cmocka_unit_test(the_monitor_follows_the_power_in_steps_of_a_third_of_a_millivolt),
        cmocka_unit_test(a_long_sleep_costs_no_more_than_sixty_time_constants),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
