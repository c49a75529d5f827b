// SPDX-License-Identifier: MIT
// Passes over the whole set: the sums of fit/kernel.h, the parts shared over control->pool (without
// one all of them on the calling thread) and added in their order, so that they are the same to the
// bit. Within a task of the pool (a niche, an individual) they run on that task's thread.
#pragma once
#include "fit/control.h"
#include "fit/kernel.h"

// False when canceled.
bool passes_moments(const struct fit_set *set, const double x[FIT_PARAMS],
                    struct fit_control *control, struct kernel_gram *ret_gram);
bool passes_gram(const struct fit_set *set, const double x[FIT_PARAMS],
                 struct fit_control *control, struct kernel_gram *ret_gram);
