// SPDX-License-Identifier: MIT
// One polarisation channel of the model: light of state `in` falls on the surface, a detector
// behind an ideal analyser for `out` looks at it (BRDF_STATE_U: no analyser). With the Mueller
// BRDF F, generator g and analyser a the channel is
//
//   f = 1/2 a^T F g,   without an analyser  f = (F g)_0,
//
// and that is
//
//   f = ks v A exp(-v tan^2 theta) (w_ss |rs|^2 + w_pp |rp|^2 + w_re Re(rs rp*) + w_im Im(rs rp*))
//       + kd w_kd B,      v = 1/(2 sigma^2),  B = 1/cos theta_i or 1/pi,
//
// A and tan^2 theta of struct brdf_geometry, rs and rp of struct brdf_fresnel. The five weights
// depend on the directions and the states only: a fit computes them once for each reading.
// Unpolarised light without an analyser is f_00: w_ss = w_pp = 1/2, w_re = w_im = 0, w_kd = 1.
// Pure: any thread.
#pragma once
#include "model/geometry.h"
#include "model/state.h"

struct brdf_channel {
    double w_ss, w_pp, w_re, w_im; // |w| <= 1
    double w_kd;                   // 1 without an analyser, 1/2 behind one: kd depolarises
};

// The first four are NAN when the geometry is. w_re^2 + w_im^2 <= 4 w_ss w_pp, with equality for
// two pure states.
struct brdf_channel brdf_channel(const struct brdf_geometry *g, enum brdf_state in,
                                 enum brdf_state out);
