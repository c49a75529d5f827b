// SPDX-License-Identifier: MIT
// uses: sim model base
// Settings of the simulated bench: table, file and command line say the same.
#include "sim/benchfile.h"
#include "sim/config.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static struct sim_config defaults(void)
{
    struct sim_config c;
    struct gon_error err = {.text = ""};
    if (sim_config_defaults(&c, &err))
        fail_msg("%s", err.text);
    return c;
}

static char lines[2000];

static void hear(void *ctx, const char *line)
{
    (void)ctx;
    strncat(lines, line, sizeof lines - strlen(lines) - 2);
    strcat(lines, "\n");
}

static int load(struct sim_config *c, const char *text)
{
    char path[] = "/tmp/test_sim_config_XXXXXX";
    int fd = mkstemp(path);
    *lines = 0;
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), (ssize_t)strlen(text));
    close(fd);
    int rc = sim_config_file(c, path, (struct cfg_sink){hear, NULL});
    unlink(path);
    return rc;
}

static void the_table_has_the_worlds_own_defaults(void **state)
{
    (void)state;
    struct sim_config c = defaults();
    struct bench_spec own;
    bench_defaults(&own);
    sim_config_finish(&c);
    const struct world_spec *a = &c.bench.world, *b = &own.world;
    assert_memory_equal(&a->optics.sample, &b->optics.sample, sizeof b->optics.sample);
    assert_int_equal(a->optics.diffuse, b->optics.diffuse);
    assert_true(a->optics.distance_mm == b->optics.distance_mm &&
                a->optics.divergence_deg == b->optics.divergence_deg);
    assert_true(a->optics.aperture_radius_mm == b->optics.aperture_radius_mm);
    assert_true(a->optics.transmission == b->optics.transmission);
    assert_true(a->laser.warmup_s == b->laser.warmup_s &&
                a->laser.temperatures_s == b->laser.temperatures_s);
    assert_true(a->laser.rin_rms == b->laser.rin_rms && a->laser.rin_tau_s == b->laser.rin_tau_s);
    assert_true(a->laser.drift_rms == b->laser.drift_rms &&
                a->laser.drift_tau_s == b->laser.drift_tau_s);
    assert_true(a->laser.power_max_w == b->laser.power_max_w &&
                a->laser.power_w == b->laser.power_w);
    assert_true(a->responsivity_v_per_w == b->responsivity_v_per_w && a->offset_v == b->offset_v);
    assert_true(a->noise_v_per_rthz == b->noise_v_per_rthz &&
                a->monitor_v_per_w == b->monitor_v_per_w);
    assert_true(a->monitor_dark_v == b->monitor_dark_v && a->monitor_noise_v == b->monitor_noise_v);
    assert_true(a->seed == b->seed && a->reference_hz == b->reference_hz);
    assert_memory_equal(&a->elements, &b->elements, sizeof b->elements);
    assert_memory_equal(a->axis, b->axis, sizeof b->axis);
    assert_memory_equal(c.bench.steps_per_unit, own.steps_per_unit, sizeof own.steps_per_unit);
    assert_true(c.bench.home_speed == own.home_speed && c.bench.start_s == own.start_s);
    assert_true(c.bench.home_acceleration == own.home_acceleration);
    assert_true(c.bench.laser_reply_s == own.laser_reply_s &&
                c.bench.detector_reply_s == own.detector_reply_s);
    assert_true(c.bench.axes_reply_s == own.axes_reply_s && c.bench.homed == own.homed);
}

static void single_settings_are_found_by_their_path(void **state)
{
    (void)state;
    struct sim_config c = defaults();
    struct gon_error err = {.text = ""};
    assert_int_equal(sim_config_set(&c, "sample.sigma", "0.3", &err), 0);
    assert_int_equal(sim_config_set(&c, "sample.diffuse", "lambert", &err), 0);
    assert_int_equal(sim_config_set(&c, "wires.speed", "false", &err), 0);
    assert_int_equal(sim_config_set(&c, "wires.axes_baud", "9600", &err), 0);
    assert_int_equal(sim_config_set(&c, "seed", "77", &err), 0);
    sim_config_finish(&c);
    assert_true(c.bench.world.optics.sample.sigma == 0.3);
    assert_int_equal(c.bench.world.optics.diffuse, BRDF_DIFFUSE_LAMBERT);
    assert_false(c.wire_speed);
    assert_int_equal(c.axes_baud, 9600);
    assert_int_equal(c.bench.world.seed, 77);
}

static void wrong_settings_say_what_is_allowed(void **state)
{
    (void)state;
    static const struct {
        const char *name, *value, *expected;
    } wrong[] = {{"sample.sigma", "0", "allowed 0.001..1"},
                 {"seed", "-1", "allowed whole numbers 0..2147483647"},
                 {"sample.sigma", "nan", "allowed 0.001..1"},
                 {"sample.sigma", "0.1x", "allowed 0.001..1"},
                 {"laser.warmup_s", "-1", "allowed 0.01..3600 s"},
                 {"seed", "1.5", "whole numbers"},
                 {"detector.slope_db", "13", "6, 12, 18, 24"},
                 {"sample.diffuse", "matt", "allowed paper, lambert"},
                 {"wires.speed", "yes", "allowed true, false"},
                 {"sample.sigam", "0.1", "did you mean 'sigma'"},
                 {"sampel.sigma", "0.1", "unknown setting"},
                 {"sample", "1", "is a group"},
                 {"seed.x", "1", "unknown setting"}};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct sim_config c = defaults(), before = c;
        struct gon_error err = {.text = ""};
        assert_int_equal(sim_config_set(&c, wrong[i].name, wrong[i].value, &err), GON_E_INPUT);
        if (!strstr(err.text, wrong[i].expected))
            fail_msg("'%s' does not say '%s'", err.text, wrong[i].expected);
        assert_memory_equal(&c, &before, sizeof c);
    }
}

static void a_file_sets_what_it_names_and_mistakes_set_nothing(void **state)
{
    (void)state;
    struct sim_config c = defaults();
    assert_int_equal(load(&c, "seed = 5;\nsample: { n = 2; diffuse = \"lambert\"; };\n"), 0);
    assert_int_equal(c.seed, 5);
    assert_true(c.bench.world.optics.sample.n == 2 && c.bench.world.optics.sample.kd == 0.05);
    assert_true(c.bench.world.axis[WORLD_THETA_R].max ==
                185); // what the table does not reach stays
    struct sim_config before = c;
    assert_int_equal(load(&c, "seed = 6;\nsample: { nn = 2.0; };\n"), GON_E_INPUT);
    assert_non_null(strstr(lines, ":2:"));
    assert_int_equal(load(&c, "detector: { slope_db = 13; };\n"), GON_E_INPUT);
    assert_non_null(strstr(lines, "6, 12, 18, 24"));
    assert_memory_equal(&c, &before, sizeof c);
}

static void the_shipped_file_is_the_defaults(void **state)
{
    (void)state;
    struct sim_config c = defaults(), file = c;
    *lines = 0;
    int rc = sim_config_file(&file, "configs/sim.cfg", (struct cfg_sink){hear, NULL});
    if (rc)
        fail_msg("%s", lines);
    assert_memory_equal(&file, &c, sizeof c);
    assert_int_equal(
        sim_config_file(&file, "configs/sim-glossy.cfg", (struct cfg_sink){hear, NULL}), 0);
}

static void the_bench_file_says_where_everything_is(void **state)
{
    (void)state;
    char *text = NULL;
    size_t size;
    struct sim_config c = defaults();
    sim_config_fast(&c);
    FILE *out = open_memstream(&text, &size);
    benchfile_write(
        out, &c,
        &(struct benchfile_links){"modbus-tcp:127.0.0.1:1", "tcp:127.0.0.1:2", "tcp:127.0.0.1:3"});
    fclose(out);
    assert_non_null(strstr(text, "link = \"modbus-tcp:127.0.0.1:1\""));
    assert_non_null(
        strstr(text, "name = \"theta_r\"; driver = \"oriental-az\"; bus = \"axes\"; unit = 2;"));
    assert_non_null(strstr(text, "speed = 300.0; acceleration = 60000.0; backlash = 0.02;"));
    assert_non_null(strstr(text, "time_constant_s = 0.001; slope_db = 12;"));
    struct cfg_file *f = cfg_parse(text, "goniod.cfg", (struct cfg_sink){hear, NULL}); // its syntax
    assert_non_null(f);
    cfg_close(f);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_table_has_the_worlds_own_defaults),
        cmocka_unit_test(single_settings_are_found_by_their_path),
        cmocka_unit_test(wrong_settings_say_what_is_allowed),
        cmocka_unit_test(a_file_sets_what_it_names_and_mistakes_set_nothing),
        cmocka_unit_test(the_shipped_file_is_the_defaults),
        cmocka_unit_test(the_bench_file_says_where_everything_is),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
