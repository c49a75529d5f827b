// SPDX-License-Identifier: MIT
// Which further measurement would help most: for each of a few candidates, the uncertainties that
// the fit would have with it, computed from the Fisher information of the candidate's readings at
// the fitted parameters, added to what the data hold already.
//
// FIT_MEASURE_NOTHING is there unless the weights are 1/u^2 already: other weights waste readings,
// and what a candidate gains beyond it is the candidate's own. Candidates are compared at the same
// effort: each adds as many readings as the data have, spread over its channels. Polarised ones
// look in the directions of the data, FIT_MEASURE_GRAZING at sweeps every 5 deg from beyond the
// largest theta_i of the data to 80 deg, theta_r as far out as the data go. Their noise is that of
// the data: a relative part and a floor, fitted to the data's u or, without u, to the residuals.
// Linear theory at a point: a parameter on its bound or in a curved valley can do otherwise, and
// nothing of it covers model error.
#pragma once
#include "fit/covariance.h"
#include "fit/noise.h"

// Directions of a measurement, and the channels measured in each of them: any of the 7 x 7.
#define ADVICE_CHANNELS 49
struct advice_plan {
    size_t count;
    const double *theta_i_rad, *theta_r_rad, *dphi_rad;
    int channels;
    enum brdf_state in[ADVICE_CHANNELS], out[ADVICE_CHANNELS];
};

// sum J J^T / u^2 over all directions and channels, in the coordinates of fit/space.h.
void advice_information(const struct advice_plan *plan, const double x[FIT_PARAMS],
                        enum brdf_diffuse diffuse, const struct noise *noise,
                        double ret_information[FIT_PARAMS][FIT_PARAMS]);

// Fills advice, advice_count and advice_readings from the parameters already in *result. False when
// canceled.
bool advise(const struct fit_data *data, const struct fit_options *options,
            const struct covariance *cov, struct fit_control *control, struct fit_result *result);
