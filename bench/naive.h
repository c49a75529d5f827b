// SPDX-License-Identifier: MIT
// The yardstick: eq. 16 as one writes it down from the paper (with its errata mended): the facet's
// angles beta and theta, Fresnel in complex numbers, everything from the directions at every call.
#pragma once
#include "model/brdf.h"

double naive_f00(double theta_i_rad, double theta_r_rad, double dphi_rad,
                 const struct brdf_params *p);

// The same by a careful hand: cosines instead of angles, products instead of pow and cabs. Still
// complex numbers, still everything at every call.
double naive_f00_trimmed(double theta_i_rad, double theta_r_rad, double dphi_rad,
                         const struct brdf_params *p);
