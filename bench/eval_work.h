// SPDX-License-Identifier: MIT
// What bench/eval.c times: a task on some directions, and how tasks take turns.
#pragma once
#include "fit/set.h"
#include "model/batch.h"

extern const struct brdf_params eval_paint;

struct directions {
    size_t count;
    double *theta_i, *theta_r, *dphi, *f; // rad; f: readings of some kind
};

struct directions directions_paper(void); // configs/paper.cfg: 850 points
// `count` at random, of which only the first `distinct` differ.
struct directions directions_random(size_t count, size_t distinct);
void directions_free(struct directions *d);

struct task {
    const char *what;
    enum batch_level level;
    void (*run)(const struct task *t);
    int repeat; // a turn is some 100 us
    const struct directions *directions;
    const struct batch *batch;
    struct fit_set set;
    double *const *column; // BATCH_COLUMNS results
    double best_ns;        // a direction
};

void task_naive(const struct task *t);
void task_trimmed(const struct task *t);
void task_f00(const struct task *t);
void task_jacobian(const struct task *t);
void task_moments(const struct task *t);
void task_gram(const struct task *t);

// Polarised: every light is s. Ends the program when memory is short.
struct fit_set set_of(const struct directions *d, enum batch_level level, bool polarised);
void tasks_take_turns(struct task *t, int count, int rounds);

// Nanoseconds of the divider alone for F's two square roots and one division.
double divider_ns(enum batch_level level);
void *eval_must(void *memory);
