// SPDX-License-Identifier: MIT
// One optimiser at work on one task. Every method evaluates through an attempt and so gets the same
// variable projection (ks and kd in closed form), the same kernel, the same bounds and the same
// three genes in [0, 1]: n, a root of k^2, log sigma. The attempt keeps the best value, counts, and
// says when to stop. Times are of the thread's CPU clock. One thread.
#pragma once
#include "bench/peers/task.h"
#include "fit/control.h"

#define ATTEMPT_GAIN 1e-7 // relative: what counts as a gain
enum { ATTEMPT_GENES = 3, ATTEMPT_ROWS = ATTEMPT_GENES + 1 };

struct attempt {
    const struct task *task;
    bool log;            // the method is given log Delta
    double k_power;      // gene 1 is (k^2)^(1/k_power): 4 is sqrt k, 2 is k, 1 is k^2
    double target;       // Delta at which the optimum counts as reached
    bool stop_at_target; // done then
    double limit_ms;     // done after this time

    double best;             // lowest Delta of all runs
    bool hit;                // best <= target
    double start_ms, hit_ms; // hit_ms: from the start
    long values, slopes;     // evaluations without and with derivatives
    bool over;               // this run is to end
    bool done;               // and no other to begin

    // Of the run in progress: a method may be begun anew with another seed.
    double run_best, run_gene[ATTEMPT_GENES];
    long stall; // the run is over after as many evaluations without a gain; 0: never
    long idle;  // evaluations since the last gain
    struct fit_control control;
};

double attempt_now_ms(void);
void attempt_begin(struct attempt *a); // starts the clock
void attempt_run(struct attempt *a, long stall);
double attempt_spent_ms(const struct attempt *a);

// Delta at the genes, which are clamped to [0, 1]; and its derivatives by them.
double attempt_value(struct attempt *a, const double gene[ATTEMPT_GENES]);
double attempt_slope(struct attempt *a, const double gene[ATTEMPT_GENES],
                     double ret_slope[ATTEMPT_GENES]);

// The same as a least-squares problem of four rows: J^T J, J^T r and r^T r are those of all
// readings (a Cholesky factor of their Gram matrix). J is [row][gene].
void attempt_rows(struct attempt *a, const double gene[ATTEMPT_GENES], double ret_r[ATTEMPT_ROWS],
                  double ret_j[ATTEMPT_ROWS][ATTEMPT_GENES]);

// A method that does not evaluate through the attempt tells what it found.
void attempt_found(struct attempt *a, double delta);
