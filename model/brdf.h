// SPDX-License-Identifier: MIT
// The polarised microfacet BRDF of Priest and Germer (2000) in the form of Feng et al., Acta Optica
// Sinica 28(2), 290 (2008), with the paper's printed errors corrected (doc/manual.md lists them).
//
//   f_00 = ks/(2 pi) 1/(4 sigma^2) G/cos^4(theta) exp(-tan^2(theta)/(2 sigma^2))
//          / (cos theta_i cos theta_r) * (|rs(beta)|^2 + |rp(beta)|^2)/2
//          + kd/cos theta_i                                                             (eq. 16)
//
// Angles in radians: theta_i, theta_r in [0, pi/2); dphi = phi_r - phi_i, pi is the specular half
// plane (eq. 6). sigma is the rms slope per axis. BRDF in sr^-1. Outside its domain every function
// returns NAN. Pure functions: any thread.
#pragma once
#include "model/fresnel.h"
#include "model/geometry.h"

struct brdf_params {
    double n;     // refractive index, > 0
    double k;     // extinction coefficient, >= 0; N = n + ik, exp(-i omega t)
    double sigma; // rms slope per axis, > 0
    double ks;    // specular strength, >= 0
    double kd;    // diffuse strength, >= 0
};

enum brdf_diffuse {
    BRDF_DIFFUSE_PAPER,  // kd/cos theta_i: as printed; neither Lambertian nor reciprocal
    BRDF_DIFFUSE_LAMBERT // kd/pi
};

double brdf_f00(const struct brdf_params *p, enum brdf_diffuse diffuse,
                const struct brdf_geometry *g);

// Directional-hemispherical reflectance: f_00 cos theta_r over the hemisphere; absolute error <
// 1e-6 for sigma in [0.01, 0.6] and theta_i up to 89.9 deg. Some 0.1 ms (model/dhr.c).
double brdf_dhr(const struct brdf_params *p, enum brdf_diffuse diffuse, double theta_i_rad);
