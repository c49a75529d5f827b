// SPDX-License-Identifier: MIT
// The polarised microfacet BRDF of Priest and Germer (2000) in the form of Feng et al., Acta Optica
// Sinica 28(2), 290 (2008), with the paper's printed errors corrected (doc/manual.md lists them).
//
//   f_jk = ks/(2 pi) 1/(4 sigma^2) G/cos^4(theta) exp(-tan^2(theta)/(2 sigma^2))
//          / (cos theta_i cos theta_r) * m_jk
//          + kd/cos theta_i, in f_00 only                                       (eq. 16, erratum 8)
//
// m_jk is the Mueller matrix of a facet at the local angle beta (model/mueller.h), and
// m_00 = (|rs|^2 + |rp|^2)/2.
//
// Angles in radians: theta_i, theta_r in [0, pi/2); dphi = phi_r - phi_i, pi is the specular half
// plane (eq. 6). sigma is the rms slope per axis. BRDF in sr^-1. Outside its domain every function
// returns NAN. Pure functions: any thread.
#pragma once
#include "model/fresnel.h"
#include "model/geometry.h"
#include "model/mueller.h"
#include "model/state.h"

// Far beyond any surface: what they exclude would overflow.
#define BRDF_SIGMA_MIN 1e-50
#define BRDF_SIGMA_MAX 1e50
#define BRDF_STRENGTH_MAX 1e50 // of ks and kd

struct brdf_params {
    double n;     // refractive index, > 0, at most BRDF_INDEX_MAX
    double k;     // extinction coefficient, 0 to BRDF_INDEX_MAX; N = n + ik, exp(-i omega t)
    double sigma; // rms slope per axis, BRDF_SIGMA_MIN to BRDF_SIGMA_MAX
    double ks;    // specular strength, 0 to BRDF_STRENGTH_MAX
    double kd;    // diffuse strength, 0 to BRDF_STRENGTH_MAX
};

enum brdf_diffuse {
    BRDF_DIFFUSE_PAPER,  // kd/cos theta_i: as printed; neither Lambertian nor reciprocal
    BRDF_DIFFUSE_LAMBERT // kd/pi
};

double brdf_f00(const struct brdf_params *p, enum brdf_diffuse diffuse,
                const struct brdf_geometry *g);

// All sixteen f_jk; f_00 equals brdf_f00 within a few ulp.
struct brdf_mueller brdf_mueller(const struct brdf_params *p, enum brdf_diffuse diffuse,
                                 const struct brdf_geometry *g);

// What a detector behind an analyser for `out` sees of light of state `in`: 1/2 a^T F g, or
// (F g)_0 when out is BRDF_STATE_U (model/channel.h).
double brdf_between(const struct brdf_params *p, enum brdf_diffuse diffuse,
                    const struct brdf_geometry *g, enum brdf_state in, enum brdf_state out);

// Directional-hemispherical reflectance: f_00 cos theta_r over the hemisphere; absolute error <
// 1e-6 for sigma in [0.01, 0.6] and theta_i up to 89.9 deg. Some 0.2 ms (model/dhr.c).
double brdf_dhr(const struct brdf_params *p, enum brdf_diffuse diffuse, double theta_i_rad);
