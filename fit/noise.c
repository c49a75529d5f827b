// SPDX-License-Identifier: MIT
#include "fit/noise.h"

#include "fit/reading.h"

#include <math.h>

enum { N = FIT_PARAMS, SAMPLE = 2000, ROUNDS = 12 };

// f^2 of the model and the noise's square for up to SAMPLE readings; their count.
static size_t sample_noise(const struct fit_data *d, enum brdf_diffuse diffuse, const double x[N],
                           double f2[SAMPLE], double s2[SAMPLE])
{
    size_t stride = (d->count + SAMPLE - 1) / SAMPLE, used = 0;
    double lost = (double)d->count / fmax(1, (double)d->count - N);
    for (size_t i = 0; i < d->count; i += stride, used++) {
        struct brdf_geometry g =
            brdf_geometry(d->theta_i_rad[i], d->theta_r_rad[i], d->dphi_rad[i]);
        struct brdf_channel c =
            brdf_channel(&g, reading_state(d->pol_in, i), reading_state(d->pol_out, i));
        struct reading_direction at = reading_direction(&g, x);
        double j[N], f = reading_jacobian(&at, &c, x, diffuse, j), r = d->f_per_sr[i] - f;
        f2[used] = f * f;
        s2[used] = d->u_per_sr ? d->u_per_sr[i] * d->u_per_sr[i] : r * r * lost;
    }
    return used;
}

// Least squares of s2 = a f2 + b with a and b >= 0, weighted with the variance that s2 has at the
// last a and b: it scatters in proportion to itself.
struct noise noise_of(const struct fit_data *data, enum brdf_diffuse diffuse, const double x[N])
{
    double f2[SAMPLE], s2[SAMPLE], a = 0, b = 0;
    size_t count = sample_noise(data, diffuse, x, f2, s2);
    for (size_t i = 0; i < count; i++)
        b += s2[i] / (double)count;
    for (int round = 0; round < ROUNDS; round++) {
        double n = 0, sx = 0, sxx = 0, sy = 0, sxy = 0, least = 1e-12 * b;
        for (size_t i = 0; i < count; i++) {
            double w = 1 / fmax(a * f2[i] + b, least);
            w *= w;
            n += w;
            sx += w * f2[i];
            sxx += w * f2[i] * f2[i];
            sy += w * s2[i];
            sxy += w * f2[i] * s2[i];
        }
        double det = n * sxx - sx * sx;
        double slope = det > 0 ? (n * sxy - sx * sy) / det : 0;
        double level = det > 0 ? (sxx * sy - sx * sxy) / det : sy / n;
        if (slope < 0 || level < 0) { // one of them alone
            bool flat = slope < 0 || !(sxx > 0);
            slope = flat ? 0 : sxy / sxx;
            level = flat ? sy / n : 0;
        }
        if (!(slope + level > 0) || !isfinite(slope + level))
            break;
        a = slope;
        b = level;
    }
    return (struct noise){sqrt(a), sqrt(b)};
}

double noise_u(const struct noise *n, double f_per_sr)
{
    return hypot(n->relative * f_per_sr, n->floor_per_sr);
}
