// SPDX-License-Identifier: MIT
// Eq. 17 at given parameters with the model's own arithmetic (model/brdf.h), residual by residual:
// what is reported. The searches use the kernel's sums, which agree with it to 1e-12 of sum g f^2.
#pragma once
#include "fit/control.h"
#include "fit/set.h"

// 0 or FIT_E_CANCELED.
int objective_delta(const struct fit_set *set, const struct brdf_params *p,
                    struct fit_control *control, double *ret_delta);

// sqrt(g) (f - model) of reading i.
double objective_residual(const struct fit_set *set, const struct brdf_params *p, size_t i);
