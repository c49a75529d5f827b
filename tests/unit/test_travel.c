// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
#include "daemon/travel.h"
#include "tests/unit/simbench.h"
#include "tests/unit/simconfig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define STAY ((double)NAN) // leave that axis where it is

struct setting {
    struct simbench b;
    struct bench_config bench;
    struct instrument *in;
    struct cancel *cancel;
    int64_t cancel_at_ns;
    int restarts; // to come, of theta_r, while it homes
};

static int set_up(void **state)
{
    struct setting *s = calloc(1, sizeof *s);
    simbench_init(&s->b, NULL);
    simconfig_bench(&s->bench);
    struct instrument_parts parts = simbench_parts(&s->b);
    s->cancel = cancel_new();
    assert_int_equal(instrument_new(&s->bench, &parts, &s->b.clk.clk, &s->in, NULL), 0);
    assert_int_equal(travel_home(s->in, NULL, NULL), 0);
    *state = s;
    return 0;
}

static int tear_down(void **state)
{
    struct setting *s = *state;
    instrument_free(s->in);
    cancel_free(s->cancel);
    free(s);
    return 0;
}

static double load(struct setting *s, enum world_axis axis)
{
    return motion_at(&s->b.world.axis[axis], s->b.clk.t_ns).load;
}

static double travel_time_s(double distance, double speed, double acceleration)
{
    const struct bench_axis axis = {.speed = speed, .acceleration = acceleration};
    return bench_axis_move_s(&axis, 0, distance);
}

static int move(struct setting *s, double theta_i, double theta_r, double sample,
                struct travel_pose *ret, struct gon_error *err)
{
    struct travel_pose target = travel_stay();
    target.at[PART_THETA_I] = theta_i;
    target.at[PART_THETA_R] = theta_r;
    target.at[PART_SAMPLE] = sample;
    return travel_move(s->in, &target, s->cancel, ret, err);
}

static void predicted_time_of_long_and_short_moves(void **state)
{
    (void)state;
    // 20 deg/s and 60 deg/s^2: 10 deg = 0.5 s cruise + 1/3 s; 1.35 deg never reaches full speed
    assert_true(fabs(travel_time_s(10, 20, 60) - (10.0 / 20 + 20.0 / 60)) < 1e-12);
    assert_true(fabs(travel_time_s(-1.35, 20, 60) - (0.3)) < 1e-12);
    assert_float_equal(travel_time_s(0, 20, 60), 0, 0);
}

static void axes_start_together_and_arrive_in_the_predicted_time(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    assert_int_equal(move(s, 5, -50, 0, &at, NULL), 0); // and takes up the play
    const int64_t start_ns = s->b.clk.t_ns;
    assert_int_equal(move(s, 45, 30, STAY, &at, NULL), 0);
    const double s_taken = (double)(s->b.clk.t_ns - start_ns) * 1e-9;
    const double slowest = travel_time_s(80, 20, 60);
    assert_true(s_taken >= slowest && s_taken < slowest + 0.06); // one poll of 50 ms at the most
    assert_float_equal(at.at[PART_THETA_I], 45, 1e-9);
    assert_float_equal(at.at[PART_THETA_R], 30, 1e-9);
    assert_float_equal(at.at[PART_SAMPLE], 0, 1e-9);
}

static void a_move_to_where_it_stands_commands_nothing(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    assert_int_equal(move(s, 10, 20, 0, &at, NULL), 0);
    const int moves = s->b.axis[PART_THETA_I].moves + s->b.axis[PART_THETA_R].moves;
    const int64_t start_ns = s->b.clk.t_ns;
    assert_int_equal(move(s, 10, 20, 0, &at, NULL), 0);
    assert_int_equal(s->b.axis[PART_THETA_I].moves + s->b.axis[PART_THETA_R].moves, moves);
    assert_true(s->b.clk.t_ns == start_ns);
}

static void backlash_is_taken_up_from_below(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    static const double way[] = {40, 10, 9.99, 60, 59.995, -20, -19.99};
    for (size_t i = 0; i < sizeof way / sizeof way[0]; i++) {
        assert_int_equal(move(s, 5, way[i], 0, &at, NULL), 0);
        // the world's load lags its motor by up to 0.015 deg after a reversal; here it must not
        assert_float_equal(load(s, WORLD_THETA_R), way[i], 1e-9);
    }
}

static void a_missed_position_is_sought_again_twice_and_then_reported(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    struct gon_error err;
    s->b.axis[PART_THETA_R].misses = 2;
    assert_int_equal(move(s, STAY, 30, STAY, &at, &err), 0);
    assert_float_equal(at.at[PART_THETA_R], 30, 0.003);
    s->b.axis[PART_THETA_R].misses = 100;
    assert_int_equal(move(s, STAY, 50, STAY, &at, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "axis theta_r"));
    assert_non_null(strstr(err.text, "after 3 tries"));
}

static void a_lost_answer_to_a_move_is_resolved_by_reading_the_status(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    // carried out, answer lost: the move is not sent again
    assert_int_equal(move(s, 0, 0, 0, &at, NULL), 0);
    const int moves = s->b.axis[PART_THETA_R].moves;
    s->b.fail_code = GON_E_LINK;
    for (int k = 1; k < 12; k++) { // whichever call is hit; odd call numbers are carried out
        s->b.fail_at = s->b.calls + k;
        s->b.hit_done = false;
        (void)move(s, STAY, s->b.axis[PART_THETA_R].moves % 2 ? 20 : 10, STAY, &at, NULL);
    }
    s->b.fail_at = 0;
    // not carried out: read back, then sent again
    const int before = s->b.axis[PART_THETA_R].moves;
    assert_true(before > moves);
    s->b.axis[PART_THETA_R].swallow = true;
    assert_int_equal(move(s, STAY, 42, STAY, &at, NULL), 0);
    assert_float_equal(at.at[PART_THETA_R], 42, 1e-9);
}

static void a_carried_out_move_with_a_lost_answer_is_sent_once(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    assert_int_equal(move(s, 0, 0, 0, &at, NULL), 0);
    const int moves = s->b.axis[PART_THETA_R].moves;
    s->b.fail_code = GON_E_LINK;
    s->b.calls = 2; // the move is call 3: odd, so it is carried out
    s->b.fail_at = 3;
    assert_int_equal(move(s, STAY, 35, STAY, &at, NULL), 0);
    assert_true(s->b.hit_done);
    assert_int_equal(s->b.axis[PART_THETA_R].moves, moves + 1);
}

static void an_axis_that_does_not_stop_is_reported(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    struct gon_error err;
    const int64_t start_ns = s->b.clk.t_ns;
    const int stops = s->b.axis[PART_THETA_R].stops;
    assert_int_equal(move(s, 0, 0, 0, &at, &err), 0);
    s->b.axis[PART_THETA_R].frozen = false;
    s->b.axis[PART_THETA_R].frozen = true;
    clk_sleep(&s->b.clk.clk, CLK_S(1), NULL); // what was seen longer ago is asked again
    // frozen from the start: it is told to stop first and does not
    assert_int_equal(move(s, 40, 40, STAY, &at, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "axis theta_r: still moves 2 s after a stop"));
    assert_true(s->b.axis[PART_THETA_R].stops > stops);
    assert_true(s->b.clk.t_ns - start_ns < CLK_S(30));
}

static void freeze_theta_r(void *ctx, int64_t t_ns)
{
    struct setting *s = ctx;
    (void)t_ns;
    s->b.axis[PART_THETA_R].frozen = true;
}

static void a_deadline_ends_a_move(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    struct gon_error err;
    assert_int_equal(move(s, 0, 0, 0, &at, &err), 0);
    const int64_t start_ns = s->b.clk.t_ns;
    s->b.clk.on_advance = freeze_theta_r;
    s->b.clk.ctx = s;
    assert_int_equal(move(s, STAY, 20, STAY, &at, &err), GON_E_DEVICE);
    s->b.clk.on_advance = NULL;
    assert_non_null(strstr(err.text, "axis theta_r: still not at 20"));
    const double s_taken = (double)(s->b.clk.t_ns - start_ns) * 1e-9;
    assert_true(fabs(s_taken - 2 * travel_time_s(20, 20, 60) - 2) < 0.1);
}

static void an_alarm_ends_a_move_and_is_named(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    struct gon_error err;
    s->b.axis[PART_THETA_I].alarm = 0x30;
    assert_int_equal(move(s, 10, 10, 0, &at, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "axis theta_i: alarm 30h (overload)"));
}

static void a_lost_home_position_is_never_trusted(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    struct gon_error err;
    s->b.axis[PART_THETA_R].homed = false;
    assert_int_equal(move(s, 10, 10, 0, &at, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "axis theta_r: lost its home position"));
    assert_int_equal(travel_home(s->in, NULL, &err), 0);
    assert_int_equal(move(s, 10, 10, 0, &at, &err), 0);
}

static void restart_while_homing(void *ctx)
{
    struct setting *s = ctx;
    struct simbench_axis *a = &s->b.axis[PART_THETA_R];
    if (a->homing && !a->disabled && s->restarts > 0) {
        s->restarts--;
        a->homing = false;
        a->disabled = true;
        motion_halt(&s->b.world.axis[WORLD_THETA_R], s->b.clk.t_ns);
    }
}

static void homing_that_a_restart_ended_is_begun_again(void **state)
{
    struct setting *s = *state;
    struct gon_error err = {0};
    s->b.axis[PART_THETA_R].homed = false;
    motion_go(&s->b.world.axis[WORLD_THETA_R], 90.0, 20, 60, 60, s->b.clk.t_ns);
    s->b.clk.t_ns += CLK_S(10);
    s->restarts = 1;
    instrument_watch(s->in, restart_while_homing, s);
    if (travel_home(s->in, NULL, &err) < 0)
        fail_msg("%s", err.text);
    assert_true(s->b.axis[PART_THETA_R].homed);
    assert_int_equal(s->restarts, 0);
    // not for ever
    s->b.axis[PART_THETA_R].homed = false;
    motion_go(&s->b.world.axis[WORLD_THETA_R], 90.0, 20, 60, 60, s->b.clk.t_ns);
    s->b.clk.t_ns += CLK_S(10);
    s->restarts = 1000;
    assert_int_equal(travel_home(s->in, NULL, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "axis theta_r: not homed"));
}

// A drive that lost its power may have lost its enable with it: it answers, and does not move.
static void a_restarted_controller_is_identified_before_it_homes(void **state)
{
    struct setting *s = *state;
    struct gon_error err = {0};
    s->b.axis[PART_THETA_R].homed = false;
    s->b.axis[PART_THETA_R].disabled = true;
    if (travel_home(s->in, NULL, &err) < 0)
        fail_msg("%s", err.text);
    assert_true(s->b.axis[PART_THETA_R].homed);
}

static void targets_beyond_the_travel_are_refused_before_moving(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    struct gon_error err;
    const int moves = s->b.axis[PART_THETA_I].moves;
    assert_int_equal(move(s, 90, STAY, STAY, &at, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "axis theta_i: 90.0000 deg is outside its travel -5..88 deg"));
    assert_int_equal(s->b.axis[PART_THETA_I].moves, moves);
}

static void cancel_later(void *ctx, int64_t t_ns)
{
    struct setting *s = ctx;
    if (t_ns >= s->cancel_at_ns)
        cancel_request(s->cancel);
}

static void a_cancel_ends_a_move_within_a_slice(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    assert_int_equal(move(s, 0, 0, 0, &at, NULL), 0);
    s->cancel_at_ns = s->b.clk.t_ns + CLK_S(0.5);
    s->b.clk.on_advance = cancel_later;
    s->b.clk.ctx = s;
    assert_int_equal(move(s, 80, 150, 30, &at, NULL), GON_E_CANCELED);
    s->b.clk.on_advance = NULL;
    assert_true(s->b.clk.t_ns - s->cancel_at_ns <= CLK_MS(100));
    assert_int_equal(travel_stop(s->in, NULL), 0); // the caller's, after the light
    for (int i = 0; i < WORLD_AXES; i++)
        assert_false(motion_at(&s->b.world.axis[i], s->b.clk.t_ns + CLK_S(1)).moving);
    assert_true(load(s, WORLD_THETA_R) < 60);
}

static void stations_by_name(void **state)
{
    struct setting *s = *state;
    struct travel_pose pose;
    struct gon_error err;
    assert_int_equal(travel_station(s->in, "beam", &pose, &err), 0);
    assert_float_equal(pose.at[PART_THETA_R], 180, 0);
    assert_float_equal(pose.at[PART_SAMPLE], 30, 0);
    assert_int_equal(travel_station(s->in, "baem", &pose, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "\"baem\""));
}

// --- kinematics ----------------------------------------------------------------------------------

static void made_again(struct setting *s)
{
    struct instrument_parts parts = simbench_parts(&s->b);
    instrument_free(s->in);
    assert_int_equal(instrument_new(&s->bench, &parts, &s->b.clk.clk, &s->in, NULL), 0);
    assert_int_equal(travel_home(s->in, NULL, NULL), 0);
}

static void geometry_goes_through_the_kinematics(void **state)
{
    struct setting *s = *state;
    struct travel_pose pose, at;
    struct gon_error err;
    assert_int_equal(travel_to_sample(s->in, 30, -40, &pose, &err), 0);
    assert_true(pose.at[PART_THETA_I] == 30 && pose.at[PART_THETA_R] == -40 &&
                pose.at[PART_SAMPLE] == 0 && isnan(pose.at[3]));
    // the second axis becomes an arm that carries theta_i too, mounted 5 deg off
    snprintf(s->bench.axes[1].name, BENCH_NAME, "arm");
    s->bench.kinematics.rows_count = 2;
    s->bench.kinematics.rows[0] = (struct bench_row){.axis = "theta_i", .theta_i = 1};
    s->bench.kinematics.rows[1] =
        (struct bench_row){.axis = "arm", .theta_i = 1, .theta_r = 1, .offset = -5};
    made_again(s);
    assert_int_equal(travel_to_sample(s->in, 30, -40, &pose, &err), 0);
    assert_true(pose.at[1] == -15);
    assert_int_equal(travel_move(s->in, &pose, NULL, &at, &err), 0);
    assert_float_equal(load(s, WORLD_THETA_R), -15, 1e-9);
    const struct kinematics_pose geometry = kinematics_forward(instrument_kinematics(s->in), at.at);
    assert_float_equal(geometry.theta_i, 30, 1e-9);
    assert_float_equal(geometry.theta_r, -40, 1e-9);
}

// --- keep-outs -----------------------------------------------------------------------------------

static const double head[5][2] = {{25, -20}, {25, -35}, {85, -95}, {88, -60}, {60, -40}};

static void fence(struct setting *s)
{
    struct bench_keep_out *k = &s->bench.keep_out[s->bench.keep_out_count++];
    *k = (struct bench_keep_out){.name = "laser head", .vertices = 5};
    memcpy(k->vertex, head, sizeof head);
}

// By winding: another test of being inside than the product's.
static bool in_head(double x, double y)
{
    double turn = 0;
    for (int i = 0; i < 5; i++) {
        const double *a = head[i], *b = head[(i + 1) % 5];
        turn += atan2((a[0] - x) * (b[1] - y) - (b[0] - x) * (a[1] - y),
                      (a[0] - x) * (b[0] - x) + (a[1] - y) * (b[1] - y));
    }
    return fabs(turn) > 1;
}

struct guard {
    struct setting *s;
    int64_t seen_ns;
    long looks, inside;
};

// Every millisecond of virtual time, motor and load.
static void watch_head(void *ctx, int64_t t_ns)
{
    struct guard *g = ctx;
    for (; g->seen_ns < t_ns; g->seen_ns += CLK_MS(1)) {
        const struct motion_state i = motion_at(&g->s->b.world.axis[WORLD_THETA_I], g->seen_ns);
        const struct motion_state r = motion_at(&g->s->b.world.axis[WORLD_THETA_R], g->seen_ns);
        g->looks++;
        g->inside += in_head(i.motor, r.motor) || in_head(i.load, r.load);
    }
}

static double random_angle(uint64_t *state, double low, double high)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return low + (high - low) * ((double)(*state >> 11) * 0x1p-53);
}

// 400 moves to anywhere, with commands that are lost, carried out late or missed: the bench is
// never inside, and what is refused is refused before anything moves.
static void no_move_enters_a_keep_out(void **state)
{
    struct setting *s = *state;
    struct guard g = {.s = s};
    const char *text = getenv("GONIO_TEST_SEED");
    uint64_t seed = text ? strtoull(text, NULL, 10) : 1906;
    int moved = 0, refused = 0, blocked = 0, failed = 0;
    print_message("seed %llu\n", (unsigned long long)seed);
    fence(s);
    made_again(s);
    s->b.step_delay_s = 0.02; // between the axes' commands: they do not start together
    g.seen_ns = s->b.clk.t_ns;
    s->b.clk.on_advance = watch_head;
    s->b.clk.ctx = &g;
    for (int n = 0; n < 400; n++) {
        struct travel_pose at;
        struct gon_error err = {0};
        const double i = random_angle(&seed, -5, 88), r = random_angle(&seed, -120, 120);
        struct simbench_axis *hit = &s->b.axis[n % 2];
        hit->swallow = n % 5 == 0;
        hit->misses = n % 7 == 0;
        const int before = s->b.axis[0].moves + s->b.axis[1].moves;
        const int rc = move(s, i, r, STAY, &at, &err);
        moved += rc == 0;
        hit->swallow = false;
        hit->misses = 0;
        if (rc == GON_E_DEVICE && strstr(err.text, "no way")) {
            refused++;
            assert_int_equal(s->b.axis[0].moves + s->b.axis[1].moves, before);
            blocked += !strstr(err.text, "keep-out \"laser head\": the target lies in it");
        } else if (rc < 0) {
            failed++;
            assert_int_equal(travel_stop(s->in, NULL), 0);
        }
    }
    s->b.clk.on_advance = NULL;
    print_message(
        "%d moved, %d refused (%d of them on the way), %d failed; %ld looks, %ld inside\n", moved,
        refused, blocked, failed, g.looks, g.inside);
    assert_int_equal(g.inside, 0);
    assert_true(moved > 300 && refused > 10 && blocked < 10);
}

// --- the drive -----------------------------------------------------------------------------------

static void from_above_is_the_same_the_other_way_round(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    s->bench.axes[PART_THETA_R].approach = BENCH_FROM_ABOVE;
    assert_int_equal(move(s, STAY, 40, STAY, &at, NULL), 0); // up: past it and back
    const int moves = s->b.axis[PART_THETA_R].moves;
    assert_int_equal(move(s, STAY, 10, STAY, &at, NULL), 0);
    assert_int_equal(s->b.axis[PART_THETA_R].moves, moves + 1);
    assert_int_equal(move(s, STAY, 20, STAY, &at, NULL), 0);
    assert_int_equal(s->b.axis[PART_THETA_R].moves, moves + 3);
    assert_true(fabs(load(s, WORLD_THETA_R) - 20.015) < 1e-9); // the play's other end
}

static void stand_theta_r(void *ctx, int64_t t_ns)
{
    struct setting *s = ctx;
    if (t_ns > s->cancel_at_ns) { // blocked: it says that it moves, and its encoder stands
        motion_halt(&s->b.world.axis[WORLD_THETA_R], t_ns);
        s->b.axis[PART_THETA_R].frozen = true;
    }
}

static void an_axis_that_stands_while_it_moves_is_blocked(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    struct gon_error err;
    assert_int_equal(move(s, 0, 0, 0, &at, NULL), 0);
    s->cancel_at_ns = s->b.clk.t_ns + CLK_S(1);
    s->b.clk.on_advance = stand_theta_r;
    s->b.clk.ctx = s;
    assert_int_equal(move(s, STAY, 120, STAY, &at, &err), GON_E_DEVICE);
    s->b.clk.on_advance = NULL;
    assert_non_null(strstr(err.text, "axis theta_r: says that it moves but has stood at"));
    assert_true(s->b.clk.t_ns - s->cancel_at_ns < CLK_S(2));
}

static void shove_theta_r(void *ctx, int64_t t_ns)
{
    struct setting *s = ctx;
    if (t_ns > s->cancel_at_ns) {
        motion_go(&s->b.world.axis[WORLD_THETA_R], 25, 20, 60, 60, t_ns);
        s->b.clk.on_advance = NULL;
    }
}

static void an_axis_that_moves_without_a_command_is_reported(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    struct gon_error err;
    assert_int_equal(move(s, 0, 20, 0, &at, NULL), 0);
    s->cancel_at_ns = s->b.clk.t_ns + CLK_MS(500);
    s->b.clk.on_advance = shove_theta_r;
    s->b.clk.ctx = s;
    assert_int_equal(move(s, 80, 20, 0, &at, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "axis theta_r: moved by itself from 20.0000 to 2"));
}

static void an_axis_that_lags_is_stopped_when_a_limit_is_set(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    struct gon_error err;
    s->bench.axes[PART_THETA_R].following_error = 1;
    assert_int_equal(move(s, 40, 100, 0, &at, &err), 0); // a good axis stays within
    s->cancel_at_ns = s->b.clk.t_ns + CLK_S(1);
    s->b.clk.on_advance = stand_theta_r;
    s->b.clk.ctx = s;
    assert_int_equal(move(s, STAY, -60, STAY, &at, &err), GON_E_DEVICE);
    s->b.clk.on_advance = NULL;
    assert_non_null(strstr(err.text, "off its way (following_error 1)"));
    assert_true(s->b.clk.t_ns - s->cancel_at_ns < CLK_S(0.6)); // before it counts as standing
}

static void retries_are_the_axiss_own(void **state)
{
    struct setting *s = *state;
    struct travel_pose at;
    struct gon_error err;
    s->bench.axes[PART_THETA_R].retries = 0;
    s->b.axis[PART_THETA_R].misses = 1;
    assert_int_equal(move(s, STAY, 50, STAY, &at, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "after 1 tries"));
}

int main(void)
{
#define T(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        T(predicted_time_of_long_and_short_moves),
        T(axes_start_together_and_arrive_in_the_predicted_time),
        T(a_move_to_where_it_stands_commands_nothing),
        T(backlash_is_taken_up_from_below),
        T(a_missed_position_is_sought_again_twice_and_then_reported),
        T(a_lost_answer_to_a_move_is_resolved_by_reading_the_status),
        T(a_carried_out_move_with_a_lost_answer_is_sent_once),
        T(an_axis_that_does_not_stop_is_reported),
        T(a_deadline_ends_a_move),
        T(an_alarm_ends_a_move_and_is_named),
        T(a_lost_home_position_is_never_trusted),
        T(a_restarted_controller_is_identified_before_it_homes),
        T(homing_that_a_restart_ended_is_begun_again),
        T(targets_beyond_the_travel_are_refused_before_moving),
        T(a_cancel_ends_a_move_within_a_slice),
        T(stations_by_name),
        T(geometry_goes_through_the_kinematics),
        T(no_move_enters_a_keep_out),
        T(from_above_is_the_same_the_other_way_round),
        T(an_axis_that_stands_while_it_moves_is_blocked),
        T(an_axis_that_moves_without_a_command_is_reported),
        T(an_axis_that_lags_is_stopped_when_a_limit_is_set),
        T(retries_are_the_axiss_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
