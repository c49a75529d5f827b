// SPDX-License-Identifier: MIT
// The yardstick: eq. 16 written down as it stands (with the paper's errata mended) in complex
// arithmetic, everything from the angles at every call. No trick, no table, and no carelessness
// either: what a first correct program looks like.
#pragma once
#include "model/brdf.h"

double naive_f00(double theta_i_rad, double theta_r_rad, double dphi_rad,
                 const struct brdf_params *p);
