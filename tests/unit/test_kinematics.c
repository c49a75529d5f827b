// SPDX-License-Identifier: MIT
// uses: campaign fit model base
#include "campaign/kinematics.h"
#include "tests/unit/randoms.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

enum { POSES = 100000 };
enum { TILT = 3, AZIMUTH = 0, ARM = 7, POLARISER = 4, ANALYSER = 11 }; // anywhere in the bench

static const struct kinematics_roles roles = {TILT, AZIMUTH, ARM, POLARISER, ANALYSER};

static double rad(double deg)
{
    return deg * (RANDOM_PI / 180);
}

static struct kinematics_pose random_pose(uint64_t *state)
{
    return (struct kinematics_pose){random_between(state, 0, 89.9),
                                    random_between(state, -89.9, 89.9),
                                    random_between(state, -89.9, 90),
                                    random_between(state, -90, 90), random_between(state, -90, 90)};
}

static struct kinematics made(const struct kinematics_row *rows, int count)
{
    struct kinematics k;
    struct gon_error err = {0};
    if (kinematics_linear(rows, count, &k, &err) < 0)
        print_error("%s\n", err.text);
    assert_string_equal(err.text, "");
    return k;
}

static struct kinematics direct(void)
{
    const struct kinematics_row rows[] = {{.axis = 1, .of = {1}}, {.axis = 0, .of = {0, 1}}};
    return made(rows, 2);
}

// Of two angles of linear polarisers, which come again after 180 deg.
static double turned(double a, double b)
{
    return fabs(remainder(a - b, 180));
}

// --- linear --------------------------------------------------------------------------------------

static void what_is_direct_stays_the_same_to_the_last_bit(void **state)
{
    (void)state;
    static const double odd[] = {-0.0, 0.0, 5e-324, -5e-324, 0.1, 1e300, -85, 45.000001};
    const struct kinematics k = direct();
    for (size_t i = 0; i < sizeof odd / sizeof *odd; i++)
        for (size_t j = 0; j < sizeof odd / sizeof *odd; j++) {
            const struct kinematics_pose pose = {odd[i], odd[j], 0, (double)NAN, (double)NAN};
            double at[KINEMATICS_AXES];
            assert_int_equal(kinematics_inverse(&k, &pose, at, NULL), 0);
            const struct kinematics_pose back = kinematics_forward(&k, at);
            assert_memory_equal(&at[1], &odd[i], sizeof *odd);
            assert_memory_equal(&at[0], &odd[j], sizeof *odd);
            assert_memory_equal(&back.theta_i, &odd[i], sizeof *odd);
            assert_memory_equal(&back.theta_r, &odd[j], sizeof *odd);
            assert_true(isnan(at[2]) && back.phi == 0);
        }
}

static void a_detector_arm_turns_about_the_source(void **state)
{
    (void)state;
    // sample = theta_i - 12; arm = theta_i + theta_r, counted the other way round
    const struct kinematics_row rows[] = {{.axis = 0, .of = {1}, .offset = -12},
                                          {.axis = 5, .of = {-1, -1}}};
    const struct kinematics k = made(rows, 2);
    const struct kinematics_pose pose = {30, -50, 0, (double)NAN, (double)NAN};
    double at[KINEMATICS_AXES];
    assert_int_equal(kinematics_inverse(&k, &pose, at, NULL), 0);
    assert_true(at[0] == 18 && at[5] == 20 && isnan(at[1]));
    const struct kinematics_pose back = kinematics_forward(&k, at);
    assert_true(back.theta_i == 30 && back.theta_r == -50);
    assert_true(kinematics_steers(&k, 0) && kinematics_steers(&k, 5) && !kinematics_steers(&k, 1));
}

static void five_coupled_axes_are_turned_back(void **state)
{
    (void)state;
    uint64_t seed = random_seed();
    double worst_deg = 0;
    struct kinematics k = direct();
    for (int n = 0; n < POSES; n++) {
        struct kinematics_row rows[KINEMATICS_COORDINATES] = {{0}};
        for (int r = 0; r < KINEMATICS_COORDINATES && n % 100 == 0; r++) {
            rows[r].axis = 2 * r;
            rows[r].offset = random_between(&seed, -180, 180);
            for (int c = 0; c < KINEMATICS_COORDINATES; c++)
                rows[r].of[c] = (r == c ? 3 : 0) + random_between(&seed, -0.5, 0.5);
        }
        if (n % 100 == 0)
            k = made(rows, KINEMATICS_COORDINATES);
        const struct kinematics_pose x = random_pose(&seed);
        double at[KINEMATICS_AXES];
        assert_int_equal(kinematics_inverse(&k, &x, at, NULL), 0);
        const struct kinematics_pose y = kinematics_forward(&k, at);
        const double off[] = {y.theta_i - x.theta_i, y.theta_r - x.theta_r, y.phi - x.phi,
                              y.polariser - x.polariser, y.analyser - x.analyser};
        for (int c = 0; c < KINEMATICS_COORDINATES; c++)
            worst_deg = fmax(worst_deg, fabs(off[c]));
    }
    printf("linear, there and back: %.2g deg\n", worst_deg);
    assert_true(worst_deg < 1e-9);
}

static void a_coordinate_that_is_not_asked_leaves_its_axis(void **state)
{
    (void)state;
    const struct kinematics_row rows[] = {
        {.axis = 0, .of = {1}}, {.axis = 1, .of = {0, 1}}, {.axis = 2, .of = {0, 0, 0, -1}}};
    const struct kinematics k = made(rows, 3);
    struct kinematics_pose pose = {30, 40, 0, (double)NAN, (double)NAN};
    double at[KINEMATICS_AXES];
    assert_int_equal(kinematics_inverse(&k, &pose, at, NULL), 0);
    assert_true(at[0] == 30 && at[1] == 40 && isnan(at[2]));
    pose.polariser = 45;
    assert_int_equal(kinematics_inverse(&k, &pose, at, NULL), 0);
    assert_true(at[2] == -45);
    assert_false(kinematics_steers(&k, 2));
}

static void wrong_rows(const struct kinematics_row *rows, int count, const char *part)
{
    struct kinematics k;
    struct gon_error err;
    assert_int_equal(kinematics_linear(rows, count, &k, &err), GON_E_INPUT);
    if (!strstr(err.text, part))
        print_error("%s\n", err.text);
    assert_non_null(strstr(err.text, part));
}

static void rows_that_cannot_be_inverted_are_refused(void **state)
{
    (void)state;
    const struct kinematics_row same[] = {{.axis = 0, .of = {1, 2}}, {.axis = 1, .of = {2, 4}}};
    const struct kinematics_row one[] = {{.axis = 0, .of = {1, 1}}};
    const struct kinematics_row blind[] = {{.axis = 0, .of = {1}}, {.axis = 1, .of = {0, 0, 1}}};
    const struct kinematics_row more[] = {
        {.axis = 0, .of = {1}}, {.axis = 1, .of = {0, 1}}, {.axis = 2, .of = {1, 1}}};
    wrong_rows(same, 2, "singular: the axes' positions do not tell theta_i, theta_r apart");
    wrong_rows(one, 1, "1 row for 2 coordinates (theta_i, theta_r)");
    wrong_rows(blind, 2, "no row has a coefficient for theta_r");
    wrong_rows(more, 3, "3 rows for 2 coordinates");
}

static void what_no_axis_moves_is_out_of_reach(void **state)
{
    (void)state;
    const struct kinematics k = direct();
    const struct kinematics_pose pose = {30, 40, 5, (double)NAN, (double)NAN};
    double at[KINEMATICS_AXES];
    struct gon_error err;
    assert_int_equal(kinematics_inverse(&k, &pose, at, &err), GON_E_INPUT);
    assert_string_equal(err.text, "phi = 5 deg: no axis of this bench moves it");
}

// --- spherical -----------------------------------------------------------------------------------

static void a_tilted_sample_is_turned_back(void **state)
{
    (void)state;
    uint64_t seed = random_seed();
    const struct kinematics k = kinematics_spherical(&roles);
    double worst_deg = 0;
    for (int n = 0; n < POSES; n++) {
        struct kinematics_pose x = random_pose(&seed);
        double at[KINEMATICS_AXES];
        if (n % 10 == 0)
            x.theta_i = 0;
        if (n % 10 == 1)
            x.phi = 0;
        if (n % 10 == 2)
            x.phi = random_log(&seed, 1e-9, 1);
        assert_int_equal(kinematics_inverse(&k, &x, at, NULL), 0);
        assert_true(fabs(at[AZIMUTH]) <= 90);
        const struct kinematics_pose y = kinematics_forward(&k, at);
        // near the normal an azimuth is worth its direction only
        const double weight = fabs(sin(rad(x.theta_r)));
        const double off[] = {y.theta_i - x.theta_i, y.theta_r - x.theta_r,
                              (y.phi - x.phi) * weight, turned(y.polariser, x.polariser),
                              turned(y.analyser, x.analyser) * weight};
        for (int c = 0; c < KINEMATICS_COORDINATES; c++)
            worst_deg = fmax(worst_deg, fabs(off[c]));
    }
    printf("spherical, there and back: %.2g deg\n", worst_deg);
    assert_true(worst_deg < 1e-9);
}

struct vector {
    double x, y, z;
};

static double dot(struct vector a, struct vector b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static struct vector cross(struct vector a, struct vector b)
{
    return (struct vector){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static struct vector unit(struct vector a)
{
    const double length = sqrt(dot(a, a));
    return (struct vector){a.x / length, a.y / length, a.z / length};
}

static struct vector mix(double a, struct vector v, double b, struct vector w)
{
    return (struct vector){a * v.x + b * w.x, a * v.y + b * w.y, a * v.z + b * w.z};
}

// Rodrigues, by deg about a unit vector.
static struct vector rotated(struct vector v, struct vector about, double deg)
{
    const double c = cos(rad(deg)), s = sin(rad(deg));
    const struct vector in_plane = mix(c, v, s, cross(about, v));
    return mix(1, in_plane, (1 - c) * dot(about, v), about);
}

// The bench built of rotations: the sample is first tilted, then turned about the beam; the arm
// carries the detector. What the model calls angles and states is then measured on it.
static void the_same_bench_in_vectors(void **state)
{
    (void)state;
    uint64_t seed = random_seed();
    const struct kinematics k = kinematics_spherical(&roles);
    const struct vector up = {0, 1, 0}, beam = {0, 0, 1};
    double worst = 0;
    for (int n = 0; n < POSES; n++) {
        const struct kinematics_pose p = random_pose(&seed);
        double at[KINEMATICS_AXES];
        if (p.theta_i < 0.1 || fabs(p.theta_r) < 0.1)
            continue;
        assert_int_equal(kinematics_inverse(&k, &p, at, NULL), 0);
        const struct vector normal = rotated(rotated(beam, up, at[TILT]), beam, at[AZIMUTH]);
        const struct vector detector = rotated(beam, up, at[ARM]);
        worst = fmax(worst, fabs(dot(normal, beam) - cos(rad(p.theta_i))));
        worst = fmax(worst, fabs(dot(normal, detector) - cos(rad(p.theta_r))));
        // dphi counts about the normal, from the source's side to the detector's
        const struct vector source_side = unit(mix(1, beam, -dot(beam, normal), normal));
        const struct vector across = cross(normal, source_side);
        const double dphi = atan2(dot(detector, across), dot(detector, source_side));
        const double want = rad(p.theta_r >= 0 ? 180 + p.phi : p.phi);
        worst =
            fmax(worst, fabs(remainder(dphi - want, 2 * RANDOM_PI)) * sin(rad(fabs(p.theta_r))));
        // s = z x k, p = k x s; fields along angles from s towards p, and as the elements stand
        const struct vector ki = mix(-1, beam, 0, beam), kr = detector;
        const struct vector si = unit(cross(normal, ki)), sr = unit(cross(normal, kr));
        const struct vector ei =
            mix(cos(rad(p.polariser)), si, sin(rad(p.polariser)), cross(ki, si));
        const struct vector er = mix(cos(rad(p.analyser)), sr, sin(rad(p.analyser)), cross(kr, sr));
        const struct vector gi =
            mix(cos(rad(at[POLARISER])), up, sin(rad(at[POLARISER])), cross(ki, up));
        const struct vector gr =
            mix(cos(rad(at[ANALYSER])), up, sin(rad(at[ANALYSER])), cross(kr, up));
        worst = fmax(worst, 1 - fabs(dot(ei, gi)));
        worst = fmax(worst, 1 - fabs(dot(er, gr)));
    }
    printf("spherical, against vectors: %.2g\n", worst);
    assert_true(worst < 1e-12);
}

static void in_plane_it_is_a_detector_arm(void **state)
{
    (void)state;
    const struct kinematics k = kinematics_spherical(&roles);
    for (int theta_i = 0; theta_i < 90; theta_i += 3)
        for (int theta_r = -89; theta_r < 90; theta_r++) {
            const struct kinematics_pose p = {theta_i, theta_r, 0, 45, -45};
            double at[KINEMATICS_AXES];
            assert_int_equal(kinematics_inverse(&k, &p, at, NULL), 0);
            assert_true(at[TILT] == theta_i && at[AZIMUTH] == 0 && at[ARM] == theta_i + theta_r);
            assert_true(at[POLARISER] == 45 && fabs(at[ANALYSER] + 45) < 1e-12);
            const struct kinematics_pose back = kinematics_forward(&k, at);
            assert_true(back.theta_i == theta_i && back.theta_r == theta_r && back.phi == 0);
        }
    const double beam[KINEMATICS_AXES] = {[ARM] = 180};
    const struct kinematics_pose through = kinematics_forward(&k, beam);
    assert_true(through.theta_i == 0 && through.theta_r == 180);
}

// From one side of the normal to the other no axis jumps: steps of 0.01 deg move none by more than
// what that is worth at the sample's tilt.
static void the_normal_is_crossed_without_a_jump(void **state)
{
    (void)state;
    const struct kinematics k = kinematics_spherical(&roles);
    static const double phi[] = {0, 1, 30, 89, -60};
    for (size_t f = 0; f < sizeof phi / sizeof *phi; f++)
        for (double theta_i = 5; theta_i < 80; theta_i += 25) {
            double before[KINEMATICS_AXES];
            for (int n = -200; n <= 200; n++) {
                const struct kinematics_pose p = {theta_i, 0.01 * n, phi[f], 0, 0};
                double at[KINEMATICS_AXES];
                assert_int_equal(kinematics_inverse(&k, &p, at, NULL), 0);
                const double most = 0.011 * (1 + 2 / sin(rad(theta_i)));
                for (int i = 0; i < KINEMATICS_AXES && n > -200; i++)
                    assert_true(isnan(at[i]) || fabs(at[i] - before[i]) <= most);
                memcpy(before, at, sizeof at);
            }
        }
}

static void unreachable(struct kinematics_pose pose, bool elements, const char *text)
{
    const struct kinematics_roles bare = {TILT, AZIMUTH, ARM, -1, -1};
    const struct kinematics k = kinematics_spherical(elements ? &roles : &bare);
    double at[KINEMATICS_AXES];
    struct gon_error err = {0};
    assert_int_equal(kinematics_inverse(&k, &pose, at, &err), GON_E_INPUT);
    assert_string_equal(err.text, text);
}

static void what_cannot_be_reached_says_why(void **state)
{
    (void)state;
    const double none = (double)NAN;
    unreachable((struct kinematics_pose){-1, 0, 0, none, none}, true,
                "theta_i = -1 deg: the light would not fall on the sample's face; allowed 0..90 "
                "deg");
    unreachable((struct kinematics_pose){90, 0, 0, none, none}, true,
                "theta_i = 90 deg: the light would not fall on the sample's face; allowed 0..90 "
                "deg");
    unreachable((struct kinematics_pose){10, -95, 0, none, none}, true,
                "theta_r = -95 deg: the detector would be behind the sample's face; allowed "
                "-90..90 deg");
    unreachable((struct kinematics_pose){10, 20, 120, none, none}, true,
                "phi = 120 deg: allowed -90..90 deg; beyond, turn phi by 180 deg and change the "
                "sign of theta_r");
    unreachable((struct kinematics_pose){10, 20, 0, 45, none}, false,
                "polariser = 45 deg: no axis of this bench turns it");
    unreachable((struct kinematics_pose){10, 20, 0, none, 45}, false,
                "analyser = 45 deg: no axis of this bench turns it");
}

// --- bounds --------------------------------------------------------------------------------------

static void check_reach(const struct kinematics *k, uint64_t *seed)
{
    double at[KINEMATICS_AXES], half[KINEMATICS_AXES];
    for (int i = 0; i < KINEMATICS_AXES; i++) {
        at[i] = random_between(seed, -90, 90);
        half[i] = random_next(seed) % 3 ? random_log(seed, 1e-3, 60) : 0;
    }
    const struct kinematics_reach reach = kinematics_reach(k, at, half);
    for (int n = 0; n < 30; n++) {
        double there[KINEMATICS_AXES];
        for (int i = 0; i < KINEMATICS_AXES; i++)
            there[i] = at[i] + half[i] * random_between(seed, -1, 1);
        const struct kinematics_pose p = kinematics_forward(k, there);
        const double off = fabs(p.theta_r - reach.theta_r);
        const double other = reach.mirrored ? fabs(p.theta_r + reach.theta_r) : off;
        assert_true(fabs(p.theta_i - reach.theta_i) <= reach.half_theta_i + 1e-9);
        assert_true(fmin(off, other) <= reach.half_theta_r + 1e-9);
    }
}

static void what_axes_reach_is_within_its_bounds(void **state)
{
    (void)state;
    uint64_t seed = random_seed();
    const struct kinematics_row rows[] = {{.axis = 2, .of = {1, 0.3}, .offset = 7},
                                          {.axis = 6, .of = {-0.5, 2}}};
    const struct kinematics linear = made(rows, 2), spherical = kinematics_spherical(&roles);
    for (int n = 0; n < 20000; n++) {
        check_reach(&linear, &seed);
        check_reach(&spherical, &seed);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_direct_stays_the_same_to_the_last_bit),
        cmocka_unit_test(a_detector_arm_turns_about_the_source),
        cmocka_unit_test(five_coupled_axes_are_turned_back),
        cmocka_unit_test(a_coordinate_that_is_not_asked_leaves_its_axis),
        cmocka_unit_test(rows_that_cannot_be_inverted_are_refused),
        cmocka_unit_test(what_no_axis_moves_is_out_of_reach),
        cmocka_unit_test(a_tilted_sample_is_turned_back),
        cmocka_unit_test(the_same_bench_in_vectors),
        cmocka_unit_test(in_plane_it_is_a_detector_arm),
        cmocka_unit_test(the_normal_is_crossed_without_a_jump),
        cmocka_unit_test(what_cannot_be_reached_says_why),
        cmocka_unit_test(what_axes_reach_is_within_its_bounds),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
