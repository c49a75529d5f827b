// SPDX-License-Identifier: MIT
// uses: sim model base
// The simulated elements of polarisation: Malus, extinction, mounts, and the sample between them.
#include "base/units.h"
#include "model/brdf.h"
#include "sim/benchfile.h"
#include "sim/config.h"
#include "sim/world.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

static struct elements_spec ideal(enum brdf_state laser)
{
    return (struct elements_spec){
        .present = true, .laser = laser, .polariser = {1, 0}, .analyser = {1, 0}};
}

static bool near(double a, double b)
{
    return fabs(a - b) <= 1e-12 * fmax(1, fabs(b));
}

static double of_beam(const struct elements_spec *e, double polariser_deg, double analyser_deg)
{
    const struct elements_view v = elements_view(e, polariser_deg, analyser_deg);
    return elements_of_beam(&v);
}

static void crossed_elements_pass_what_malus_says(void **state)
{
    (void)state;
    const struct elements_spec u = ideal(BRDF_STATE_U), s = ideal(BRDF_STATE_S);
    for (int deg = -10; deg <= 190; deg += 10) {
        const double c2 = pow(cos(units_rad(deg)), 2);
        assert_true(near(of_beam(&u, 0, deg), 0.5 * c2)); // half of unpolarised light
        assert_true(near(of_beam(&s, 0, deg), c2));
        assert_true(near(of_beam(&s, deg, 270), c2)); // the analyser is out
        assert_true(near(of_beam(&s, deg, 90), c2 * (1 - c2)));
    }
    struct elements_spec real = ideal(BRDF_STATE_S);
    real.polariser = real.analyser = (struct element_spec){0.9, 1e-3};
    assert_true(near(of_beam(&real, 270, 0), 0.9) && near(of_beam(&real, 270, 90), 0.9e-3));
    assert_true(near(of_beam(&real, 0, 0), 0.81) && near(of_beam(&real, 90, 90), 0.81e-6));
    assert_true(near(of_beam(&real, 45, 270), 0.45 * 1.001));
}

static void circular_light_has_no_axis(void **state)
{
    (void)state;
    const struct elements_spec r = ideal(BRDF_STATE_R);
    for (int deg = 0; deg < 180; deg += 15)
        assert_true(near(of_beam(&r, deg, 270), 0.5) && near(of_beam(&r, 270, deg), 0.5));
}

static void a_mount_is_dark_between_element_and_free_path(void **state)
{
    (void)state;
    const struct elements_spec u = ideal(BRDF_STATE_U);
    assert_true(of_beam(&u, 270, 270) == 1 && of_beam(&u, 280, 250) == 1);
    assert_true(of_beam(&u, 220, 270) == 0 && of_beam(&u, 270, 220) == 0);
    assert_true(of_beam(&u, 270, -20) == 0);
    struct elements_spec none = u;
    none.present = false; // wherever the mounts would be
    assert_true(of_beam(&none, 220, 220) == 1 && elements_are_idle(&none));
    none.laser = BRDF_STATE_P;
    assert_false(elements_are_idle(&none) || elements_are_idle(&u));
}

// Ideal elements are the model's channels; half of an unpolarised laser's light passes the first.
static void the_sample_between_ideal_elements_is_the_models_channel(void **state)
{
    (void)state;
    static const struct {
        double deg;
        enum brdf_state is;
    } states[] = {{270, BRDF_STATE_U},
                  {0, BRDF_STATE_S},
                  {90, BRDF_STATE_P},
                  {45, BRDF_STATE_PLUS45},
                  {135, BRDF_STATE_MINUS45}};
    struct world_spec w;
    const struct elements_spec e = ideal(BRDF_STATE_U);
    world_defaults(&w);
    w.optics.sample.k = 0.7;
    for (int i = 0; i < 5; i++)
        for (int k = 0; k < 5; k++)
            for (double theta_r_deg = -70; theta_r_deg <= 80; theta_r_deg += 25) {
                const struct elements_view v = elements_view(&e, states[i].deg, states[k].deg);
                const struct brdf_geometry g = brdf_geometry(
                    units_rad(40), units_rad(fabs(theta_r_deg)), theta_r_deg < 0 ? 0 : UNITS_PI);
                const double f = brdf_between(&w.optics.sample, w.optics.diffuse, &g, states[i].is,
                                              states[k].is);
                assert_true(near(optics_between_per_sr(&w.optics, &v, 40, theta_r_deg),
                                 states[i].is == BRDF_STATE_U ? f : f / 2));
            }
}

static void the_detector_sees_what_the_elements_let_through(void **state)
{
    (void)state;
    struct world w;
    struct world_spec spec;
    world_defaults(&spec);
    spec.offset_v = 0;
    spec.elements.present = true;
    world_init(&w, &spec, 0);
    const double at[] = {30, 40, 0, 90, 0};
    for (int i = 0; i < WORLD_AXES; i++)
        motion_init(&w.axis[i], -185, 285, 0, at[i]);
    w.view.per_w = (double)NAN;
    const struct elements_view v = elements_view(&spec.elements, 90, 0);
    const struct optics_scene scene = {30, 40, 0, 1, &v};
    sim_laser_start(&w.laser, true);
    w.laser.state = SIM_LASER_COMPLETED;
    sim_laser_step(&w.laser, 1000000000);
    const double power_w = sim_laser_power_w(&w.laser);
    assert_true(power_w > 0);
    const double v_expected =
        spec.responsivity_v_per_w * power_w * optics_detected_w(&spec.optics, &scene);
    assert_true(fabs(world_input_v(&w, w.t_ns) / v_expected - 1) < 1e-12);
    motion_init(&w.axis[WORLD_ANALYSER], -15, 285, 0, 270); // and notices that an element moved
    w.axis[WORLD_ANALYSER].plan++;
    assert_true(world_input_v(&w, w.t_ns) > 2 * v_expected);
}

static char *bench_file(bool elements, const char *laser)
{
    struct sim_config c;
    struct gon_error err = {.text = ""};
    char *text = NULL;
    size_t size;
    assert_int_equal(sim_config_defaults(&c, &err), 0);
    assert_int_equal(sim_config_set(&c, "polarisation.elements", elements ? "true" : "false", &err),
                     0);
    assert_int_equal(sim_config_set(&c, "laser.polarisation", laser, &err), 0);
    sim_config_finish(&c);
    FILE *out = open_memstream(&text, &size);
    benchfile_write(out, &c, &(struct benchfile_links){"modbus-tcp:h:1", "tcp:h:2", "tcp:h:3"});
    fclose(out);
    return text;
}

static void the_bench_file_has_elements_only_when_they_are_there(void **state)
{
    (void)state;
    char *text = bench_file(false, "u");
    assert_null(strstr(text, "polariser"));
    assert_null(strstr(text, "polarisation:"));
    free(text);
    text = bench_file(true, "u");
    assert_non_null(strstr(text, "name = \"analyser\"; driver = \"oriental-az\"; bus = \"axes\"; "
                                 "unit = 5;"));
    assert_non_null(
        strstr(text, "{ is = \"p\"; axes = ( { name = \"polariser\"; at = 90.0; } ); }"));
    assert_non_null(
        strstr(text, "{ is = \"u\"; axes = ( { name = \"analyser\"; at = 270.0; } ); }"));
    assert_non_null(strstr(text, "transmission = 0.9; u_transmission = 0.0018;"));
    free(text);
    text = bench_file(true, "s");
    assert_non_null(strstr(text, "polarisation = \"s\""));
    assert_null(strstr(text, "name = \"polariser\"; at = 270.0")); // s is at 0 already
    free(text);
}

static void only_a_world_with_elements_has_their_axes(void **state)
{
    (void)state;
    struct world_spec spec;
    world_defaults(&spec);
    assert_int_equal(world_axes(&spec), 3);
    spec.elements.present = true;
    assert_int_equal(world_axes(&spec), 5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(crossed_elements_pass_what_malus_says),
        cmocka_unit_test(circular_light_has_no_axis),
        cmocka_unit_test(a_mount_is_dark_between_element_and_free_path),
        cmocka_unit_test(the_sample_between_ideal_elements_is_the_models_channel),
        cmocka_unit_test(the_detector_sees_what_the_elements_let_through),
        cmocka_unit_test(the_bench_file_has_elements_only_when_they_are_there),
        cmocka_unit_test(only_a_world_with_elements_has_their_axes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
