// SPDX-License-Identifier: MIT
// What a method did over many attempts, and how it is said. Owns its list of times.
#pragma once
#include "bench/peers/method.h"

struct score {
    const struct setting *setting;
    double *ms; // one an attempt
    int count, hits;
    double passes; // evaluations in all, with and without derivatives
    double below;  // most by which it went below the best known Delta, relative
};

bool score_new(struct score *ret_score, const struct setting *s, int attempts);
void score_free(struct score *s);

// One attempt: runs begun anew until the optimum is reached, which ends the clock (to_optimum), or
// to their own end until as many as the setting says brought no gain.
void score_attempt(struct score *s, const struct task *t, uint64_t seed, bool to_optimum);

double score_quantile(struct score *s, double q); // of the times; sorts them
double score_reached(const struct score *s);      // share that reached the optimum

// The table's head, and a line of it: to stderr for people, a JSON object to stdout. A score
// without attempts is "not measured".
void score_title(const char *what, int tasks, uint64_t seed, int seeds);
void score_report(const char *what, struct score *s, double gonio_ms);

// How many times faster gonio is than the fastest of `count` scores that reached the optimum in a
// share of `reached` at least (those of our own making left out), beside the bar: how many
// times it should be at least.
void score_summary(const char *what, struct score *s, int count, double reached, double gonio_ms,
                   double bar);
