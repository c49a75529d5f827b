// SPDX-License-Identifier: MIT
// The default search: a population over (n, sqrt k, log sigma), spread as a Latin hypercube, with
// ks and kd solved for in closed form at every individual; the best of each niche learn by
// Levenberg-Marquardt (fit/polish.h) in rounds, after which only the better half of distinct niches
// lives on, and the last of them learn to the end. At least 8 distinct niches learn on all readings
// searched; a quarter of the readings is enough for the population and the first round. The fewer
// the readings, the more individuals and niches. Sets above MEMETIC_SAMPLE readings are searched on
// a random sample of that size, and the best niches polished on all readings.
#pragma once
#include "fit/control.h"
#include "fit/polish.h"

#define MEMETIC_SAMPLE ((size_t)4096)

// 0, FIT_E_CANCELED or FIT_E_MEMORY. trace gets the best Delta so far, on the readings searched,
// and the mean of generation 0, a few individuals, of which the best has learnt to the end; of 1,
// the population; of 2 and 3, the niches that live on; and last Delta of the result, twice. The
// best never rises but for the step from a sample to all readings. Individuals, niches and the
// passes over all readings are shared over control->pool: same result to the bit.
int memetic_search(const struct fit_set *set, const struct fit_space *space,
                   const struct fit_options *options, struct fit_control *control,
                   struct fit_optimum *ret_optimum);
