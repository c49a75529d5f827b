// SPDX-License-Identifier: MIT
// One reading of any polarisation channel with its derivatives, straight from the model: for a few
// thousand readings that need not be fast (the kernel's passes are). Pure: any thread.
#pragma once
#include "fit/fit.h"
#include "model/channel.h"
#include "model/fresnel.h"

// What f takes of a direction at given parameters: height times the channel's mix of Fresnel terms.
struct reading_direction {
    double height; // v A exp(-v tan^2 theta)
    double slope;  // d log(height) / d log(sigma)
    double inv_cos_i;
    struct brdf_fresnel f, by_n, by_kappa; // terms and their derivatives
};

// x: coordinates of fit/space.h.
struct reading_direction reading_direction(const struct brdf_geometry *g,
                                           const double x[FIT_PARAMS]);

// f in sr^-1 and its derivatives by the coordinates; of n and k^2 good to 1e-5.
double reading_jacobian(const struct reading_direction *d, const struct brdf_channel *c,
                        const double x[FIT_PARAMS], enum brdf_diffuse diffuse,
                        double ret_j[FIT_PARAMS]);

static inline enum brdf_state reading_state(const unsigned char *states, size_t i)
{
    return states ? (enum brdf_state)states[i] : BRDF_STATE_U;
}
