// SPDX-License-Identifier: MIT
// The paper's genetic algorithm (section 4): binary coding of the five parameters, proportional
// (roulette) selection, one-point crossover with probability pc, mutation with probability pm. What
// the paper leaves open is in struct fit_paper_options. Kept for comparison: it does not reach the
// optimum. Individuals are shared over control->pool: same result to the bit.
#pragma once
#include "fit/control.h"
#include "fit/polish.h"

// 0, FIT_E_CANCELED or FIT_E_MEMORY. *ret_optimum is the best individual ever seen; trace gets the
// best and the mean Delta of each generation itself, which fall steadily only with elitism (and
// then only the best).
int paper_ga_search(const struct fit_set *set, const struct fit_space *space,
                    const struct fit_options *options, struct fit_control *control,
                    struct fit_optimum *ret_optimum);
