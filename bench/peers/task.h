// SPDX-License-Identifier: MIT
// One inversion problem of the comparison with other optimisers: the paper's plan over a random
// surface, compiled once, with the lowest Delta that long multistarts find.
//
// A task owns its memory; read-only after task_new, so any thread. Angles in radians.
#pragma once
#include "fit/set.h"
#include "fit/space.h"

struct task {
    uint64_t seed;
    struct brdf_params truth;
    struct fit_data data; // borrows columns
    struct fit_options options;
    struct fit_set set;
    struct fit_space space;
    double best; // Delta, best known
    double *columns;
};

// Ten theta_i, theta_r from -85 to 85 deg by 2.5 and by 0.5 within 5 deg of specular: 850 readings
// with 2 % noise and a floor of 1e-5 sr^-1. The seed decides surface (in turn dielectric, metal,
// between) and noise; the best Delta is that of `starts` random starts, each polished to the end.
// false: out of memory.
bool task_new(struct task *ret_task, uint64_t seed, int starts);
void task_free(struct task *t);

// theta_i, theta_r, dphi (radians) and f (sr^-1), one reading a line, 17 digits; false: errno.
bool task_write(const struct task *t, const char *path);
