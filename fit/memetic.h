// SPDX-License-Identifier: MIT
// The default search: a genetic algorithm over (n, sqrt k, log sigma), ks and kd solved for in
// closed form at every evaluation, that keeps niches apart by deterministic crowding (Mahfoud 1995:
// a child replaces the parent nearest to it); then the best of at least 8 distinct niches are
// polished, the best few to convergence. Sets above MEMETIC_SAMPLE readings are searched on a
// random sample of that size and the best polished on all readings. The fewer the points, the more
// individuals and niches.
#pragma once
#include "fit/control.h"
#include "fit/polish.h"

#define MEMETIC_SAMPLE ((size_t)4096)

// 0, FIT_E_CANCELED or FIT_E_MEMORY. trace gets the best and mean Delta of each generation and,
// last, that of the polished optimum twice.
int memetic_search(const struct fit_set *set, const struct fit_space *space,
                   const struct fit_options *options, struct fit_control *control,
                   struct fit_optimum *ret_optimum);
