// SPDX-License-Identifier: MIT
// The share G of a facet that is both lit and seen, in a surface of V-shaped grooves: Torrance and
// Sparrow (1967) in Blinn's form,
//
//   G = min(1, 2 cos theta cos theta_r / cos beta, 2 cos theta cos theta_i / cos beta).
//
// The paper does not print it. It depends on the azimuth too, through theta and beta (erratum 14),
// and its derivatives jump where the minimum changes sides: in plane, theta_r = 60 deg + theta_i/3.
#pragma once
#include <math.h>

// cos_ratio: cos theta / cos beta.
static inline double shadowing(double cos_theta_i, double cos_theta_r, double cos_ratio)
{
    return fmin(1, 2 * cos_ratio * fmin(cos_theta_i, cos_theta_r));
}
