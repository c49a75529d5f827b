// SPDX-License-Identifier: MIT
// The Mueller matrix of a facet (eq. 14, which is lost in print). Indices 0..3 are S0..S3 of
// model/state.h; the matrix takes the Stokes vector of the incident light to that of the reflected.
// Pure: any thread.
#pragma once
#include "model/fresnel.h"
#include "model/geometry.h"
#include "model/state.h"

struct brdf_mueller {
    double m[4][4]; // of a facet a bare number, of a BRDF in sr^-1
};

// m[0][0] = (|rs|^2 + |rp|^2)/2. m[0][3] and m[3][0] are zero: a facet neither makes nor detects
// circular light.
struct brdf_mueller brdf_mueller_of_facet(const struct brdf_rotation *r,
                                          const struct brdf_fresnel *fresnel);

// 1/2 a^T M g; without an analyser (BRDF_STATE_U) (M g)_0.
double brdf_mueller_between(const struct brdf_mueller *m, enum brdf_state in, enum brdf_state out);
