// SPDX-License-Identifier: MIT
// What follows from a bench file that is right.
#include "campaign/bench.h"

#include "base/units.h"

#include <math.h>
#include <string.h>

// --- finding -------------------------------------------------------------------------------------

int bench_axis_index(const struct bench_config *b, const char *name)
{
    for (int i = 0; i < b->axes_count; i++)
        if (!strcmp(b->axes[i].name, name))
            return i;
    return -1;
}

const struct bench_axis *bench_find_axis(const struct bench_config *b, const char *name)
{
    const int i = bench_axis_index(b, name);
    return i >= 0 ? &b->axes[i] : NULL;
}

const struct bench_station *bench_find_station(const struct bench_config *b, const char *name)
{
    for (int i = 0; i < b->stations_count; i++)
        if (!strcmp(b->stations[i].name, name))
            return &b->stations[i];
    return NULL;
}

// --- axes ----------------------------------------------------------------------------------------

bool bench_axis_in_sweep(const struct bench_axis *a, double position)
{
    const double low = a->sweep_count ? a->sweep[0] : a->min;
    const double high = a->sweep_count ? a->sweep[1] : a->max;
    return position >= low && position <= high;
}

double bench_axis_tolerance(const struct bench_axis *a)
{
    return fmax(a->deadband, 0.5 / fabs(a->steps_per_unit)) + 1e-9;
}

void bench_axis_span(const struct bench_axis *a, double from, double to, double *ret_low,
                     double *ret_high)
{
    const double tolerance = bench_axis_tolerance(a);
    const double run_up = a->backlash > 0 ? a->backlash + tolerance : 0;
    const bool above = a->approach == BENCH_FROM_ABOVE;
    *ret_low = fmin(from, fmax(above ? to : to - run_up, a->min)) - tolerance;
    *ret_high = fmax(from, fmin(above ? to + run_up : to, a->max)) + tolerance;
}

double bench_axis_move_s(const struct bench_axis *a, double from, double to)
{
    const double distance = fabs(to - from);
    if (distance * a->acceleration < a->speed * a->speed)
        return 2.0 * sqrt(distance / a->acceleration);
    return distance / a->speed + a->speed / a->acceleration;
}

double bench_axis_on_way(const struct bench_axis *a, double from, double to, double after_s)
{
    const double distance = fabs(to - from), all_s = bench_axis_move_s(a, from, to);
    const double ramp_s = fmin(a->speed / a->acceleration, all_s / 2);
    const double left_s = all_s - after_s;
    double gone = a->acceleration * ramp_s * (after_s - ramp_s / 2);
    if (after_s <= 0)
        gone = 0;
    else if (left_s <= 0)
        gone = distance;
    else if (after_s < ramp_s)
        gone = a->acceleration * after_s * after_s / 2;
    else if (left_s < ramp_s)
        gone = distance - a->acceleration * left_s * left_s / 2;
    return to > from ? from + gone : from - gone;
}

// --- kinematics ----------------------------------------------------------------------------------

static int row_of(const struct bench_config *b, const struct bench_row *r,
                  struct kinematics_row *ret_row, struct gon_error *err)
{
    *ret_row = (struct kinematics_row){
        .axis = bench_axis_index(b, r->axis),
        .of = {r->theta_i, r->theta_r, r->phi, r->polariser, r->analyser},
        .offset = r->offset,
    };
    return ret_row->axis < 0 ? gon_fail(err, GON_E_INPUT, "axis '%s' is missing", r->axis) : GON_OK;
}

static int spherical(const struct bench_config *b, struct kinematics *ret_kinematics,
                     struct gon_error *err)
{
    const struct bench_kinematics *k = &b->kinematics;
    const struct kinematics_roles roles = {
        bench_axis_index(b, k->tilt), bench_axis_index(b, k->azimuth), bench_axis_index(b, k->arm),
        bench_axis_index(b, k->polariser), bench_axis_index(b, k->analyser)};
    if (roles.tilt < 0 || roles.azimuth < 0 || roles.arm < 0)
        return gon_fail(err, GON_E_INPUT, "axis '%s', '%s' or '%s' is missing", k->tilt, k->azimuth,
                        k->arm);
    *ret_kinematics = kinematics_spherical(&roles);
    return GON_OK;
}

int bench_kinematics(const struct bench_config *b, struct kinematics *ret_kinematics,
                     struct gon_error *err)
{
    static const struct bench_row direct[] = {{.axis = "theta_i", .theta_i = 1},
                                              {.axis = "theta_r", .theta_r = 1}};
    const struct bench_kinematics *k = &b->kinematics;
    const struct bench_row *from = k->rows_count ? k->rows : direct;
    const int count = k->rows_count ? k->rows_count : 2;
    struct kinematics_row rows[KINEMATICS_COORDINATES];
    if (k->kind == KINEMATICS_SPHERICAL)
        return spherical(b, ret_kinematics, err);
    for (int i = 0; i < count; i++)
        if (row_of(b, &from[i], &rows[i], err) < 0)
            return GON_E_INPUT;
    return kinematics_linear(rows, count, ret_kinematics, err);
}

// --- stations ------------------------------------------------------------------------------------

static bool marks_say_all(const struct bench_config *b, const struct kinematics *k,
                          const double at[BENCH_AXES])
{
    for (int i = 0; i < b->axes_count; i++)
        if (kinematics_steers(k, i) && isnan(at[i]))
            return false;
    return true;
}

int bench_station_at(const struct bench_config *b, const struct kinematics *k,
                     const struct bench_station *s, double ret_at[BENCH_AXES],
                     struct gon_error *err)
{
    const struct kinematics_pose pose = {s->theta_i_deg, s->theta_r_deg, 0, (double)NAN,
                                         (double)NAN};
    const int sample = bench_axis_index(b, "sample");
    double marked[BENCH_AXES], at[BENCH_AXES];
    for (int i = 0; i < BENCH_AXES; i++)
        at[i] = marked[i] = (double)NAN;
    for (int m = 0; m < s->marks_count; m++)
        if (bench_axis_index(b, s->marks[m].name) >= 0)
            marked[bench_axis_index(b, s->marks[m].name)] = s->marks[m].at;
    if (!marks_say_all(b, k, marked) && kinematics_inverse(k, &pose, at, err) < 0)
        return GON_E_INPUT;
    if (sample >= 0)
        at[sample] = s->sample_mm;
    for (int i = 0; i < BENCH_AXES; i++)
        ret_at[i] = isnan(marked[i]) ? at[i] : marked[i];
    return GON_OK;
}

double bench_omega_sr(const struct bench_config *b)
{
    return UNITS_PI * (b->aperture_radius_mm / b->distance_mm) *
           (b->aperture_radius_mm / b->distance_mm);
}
