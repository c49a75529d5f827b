// SPDX-License-Identifier: MIT
// The least q with one parameter held: what a profile is made of. With n, k or ks held the others
// can have several valleys (a metal of high k and one of high n reflect alike), and the deepest at
// one value need not continue the deepest at the next. So besides the start that continues the
// valley there are starts from a coarse grid over what of n and k is free, sigma and the projected
// ks and kd as they follow; a start from where the last trial ended, on the far side of the
// interval, would stay in that trial's valley. With sigma or kd held there is one valley.
#pragma once
#include "fit/covariance.h"

struct hold {
    const struct fit_set *set;
    const struct fit_space *space;
    const struct covariance *cov; // at the optimum: the direction of its valley
    struct fit_control *control;
};

// `from`: an optimum on the way, for the start and for sigma on the grid. False when canceled.
bool hold_at(const struct hold *h, enum fit_param which, double x, const struct fit_optimum *from,
             struct fit_optimum *ret_at);
