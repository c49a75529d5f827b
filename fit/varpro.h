// SPDX-License-Identifier: MIT
// The linear half of the fit in closed form: ks and kd that minimise sum g (f - ks a - kd b)^2
// within their bounds, given a's inner products (variable projection, Golub and Pereyra 1973).
// Exact also when a and b are parallel, when one of them is zero, and with equal bounds (a fixed
// parameter).
#pragma once
#include "fit/kernel.h"
#include "fit/space.h"

struct varpro {
    double ks, kd;
    double q;             // sum g r^2 there
    bool ks_free, kd_free; // not held by a bound: its gradient vanishes
};

// ks and kd at which gram's r was taken are x[FIT_KS], x[FIT_KD]; they need not lie within the
// bounds.
struct varpro varpro_solve(const struct kernel_gram *gram, const double x[FIT_PARAMS],
                           const struct fit_space *space);
