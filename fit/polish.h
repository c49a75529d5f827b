// SPDX-License-Identifier: MIT
// Local least squares from a start: Levenberg-Marquardt in (n, k^2, log sigma) with ks and kd
// projected out at every step (Kaufman's form of variable projection), within bounds. Derivatives
// are analytic. A parameter with equal bounds is held, which is how profiles are made.
#pragma once
#include "fit/control.h"
#include "fit/set.h"
#include "fit/space.h"

struct fit_optimum {
    double x[FIT_PARAMS]; // fit/space.h, within its bounds
    double q;             // sum g r^2: Delta times set->ff
};

// Improves *optimum (its x is moved into the bounds first, its q need not be set) in at most
// max_steps passes. Converged means that a further step would lower q by less than 1e-11 of it.
// False: canceled.
bool polish(const struct fit_set *set, const struct fit_space *space, int max_steps,
            struct fit_control *control, struct fit_optimum *optimum);
