// SPDX-License-Identifier: MIT
#include "sim/lockin.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define OVER 1.09 // of full scale, where the output overloads
#define INPUT_MOST_V 1.4

void lockin_init(struct lockin *l, double noise_v_per_rthz, uint64_t seed)
{
    memset(l, 0, sizeof *l);
    l->noise_v_per_rthz = noise_v_per_rthz;
    l->time_constant_s = 0.1;
    l->poles = 2;
    l->full_scale_v = 1;
    l->reserve = 100;
    l->turn_x = 1;
    noise_init(&l->noise, seed, 200);
}

// n equal poles with a constant input u: the deviations e_k = x_k - u follow e' = M e with M a
// Jordan block of eigenvalue -1/T, whose exponential is written out here.
static void filter(double *x, int poles, double u, double dt_over_t, double keep)
{
    double e[LOCKIN_POLES];
    for (int k = 0; k < poles; k++)
        e[k] = x[k] - u;
    for (int k = poles - 1; k >= 0; k--) {
        double sum = 0, weight = 1;
        for (int j = k; j >= 0; j--) {
            sum += weight * e[j];
            weight *= dt_over_t / (k - j + 1);
        }
        x[k] = u + keep * sum;
    }
    for (int k = poles; k < LOCKIN_POLES; k++)
        x[k] = x[poles - 1]; // an added pole starts where the output was
}

// What depends on the step's length and on the settings alone.
static void prepare(struct lockin *l, double dt_s)
{
    if (dt_s != l->dt_s || l->time_constant_s != l->of_time_constant_s) {
        l->dt_s = dt_s;
        l->of_time_constant_s = l->time_constant_s;
        l->keep = exp(-dt_s / l->time_constant_s);
        l->sd_v = 1 / sqrt(2 * dt_s); // white noise, averaged over dt_s
    }
    if (l->phase_rad != l->turned_rad) {
        l->turned_rad = l->phase_rad;
        l->turn_x = cos(l->phase_rad);
        l->turn_y = sin(l->phase_rad);
    }
}

void lockin_step(struct lockin *l, double signal_v, double dt_s)
{
    assert(dt_s > 0 && l->poles >= 1 && l->poles <= LOCKIN_POLES);
    double dt_over_t = dt_s / l->time_constant_s;
    prepare(l, dt_s);
    double ux = signal_v * l->turn_x + l->noise_v_per_rthz * l->sd_v * noise_normal(&l->noise);
    double uy = -signal_v * l->turn_y + l->noise_v_per_rthz * l->sd_v * noise_normal(&l->noise);
    filter(l->x, l->poles, ux, dt_over_t, l->keep);
    filter(l->y, l->poles, uy, dt_over_t, l->keep);
    if (fabs(signal_v) > fmin(l->reserve * l->full_scale_v, INPUT_MOST_V))
        l->condition |= LOCKIN_INPUT_OVERLOAD;
    if (l->poles > 1 && fmax(fabs(l->x[0]), fabs(l->y[0])) > 10 * l->full_scale_v)
        l->condition |= LOCKIN_FILTER_OVERLOAD;
    double out = fmax(fabs(l->x[l->poles - 1]), fabs(l->y[l->poles - 1]));
    if (out > OVER * l->full_scale_v)
        l->condition |= LOCKIN_OUTPUT_OVERLOAD;
}

static double shown(const struct lockin *l, double v)
{
    double most = OVER * l->full_scale_v, lsb = l->full_scale_v / 65536;
    v = rint(v / lsb) * lsb;
    return v > most ? most : v < -most ? -most : v;
}

double lockin_x_v(const struct lockin *l)
{
    return shown(l, l->x[l->poles - 1]);
}

double lockin_y_v(const struct lockin *l)
{
    return shown(l, l->y[l->poles - 1]);
}
