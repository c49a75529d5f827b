// SPDX-License-Identifier: MIT
// In the facet's frame the matrix has two blocks (model/channel.c); on either side it is turned by
// twice alpha. That is eq. 14 of the Jones matrix
//
//   Sss = rs cos a_r cos a_i + rp sin a_r sin a_i,  Sps = rs cos a_r sin a_i - rp sin a_r cos a_i,
//   Ssp = rs sin a_r cos a_i - rp cos a_r sin a_i,  Spp = rs sin a_r sin a_i + rp cos a_r cos a_i
//
// multiplied out, without a complex number and without the rounding of its absolute squares.
#include "model/mueller.h"

struct brdf_mueller brdf_mueller_of_facet(const struct brdf_rotation *r,
                                          const struct brdf_fresnel *fresnel)
{
    const double ci = brdf_cos_twice(r->cos_i, r->sin_i), si = 2 * r->cos_i * r->sin_i;
    const double cr = brdf_cos_twice(r->cos_r, r->sin_r), sr = 2 * r->cos_r * r->sin_r;
    const double mean = (fresnel->ss + fresnel->pp) / 2, half = (fresnel->ss - fresnel->pp) / 2;
    const double re = fresnel->re, im = fresnel->im;
    const double cc = cr * ci, cs = cr * si, sc = sr * ci, ss = sr * si;
    return (struct brdf_mueller){{
        {mean, half * ci, half * si, 0},
        {half * cr, mean * cc + re * ss, mean * cs - re * sc, -im * sr},
        {half * sr, mean * sc - re * cs, mean * ss + re * cc, im * cr},
        {0, im * si, -im * ci, re},
    }};
}

double brdf_mueller_between(const struct brdf_mueller *m, enum brdf_state in, enum brdf_state out)
{
    const struct brdf_stokes g = brdf_state_stokes(in), a = brdf_state_analyser(out);
    double sum = 0;
    for (int j = 0; j < 4; j++)
        for (int k = 0; k < 4; k++)
            sum += a.s[j] * m->m[j][k] * g.s[k];
    return sum;
}
