// SPDX-License-Identifier: MIT
// The optimisers that are compared, and their settings. A method works on an attempt until the
// attempt is over or its own setting ends the run.
#pragma once
#include "bench/peers/attempt.h"

struct setting;
typedef void peer_run(struct attempt *a, const struct setting *s, uint64_t seed);

// A method reads what it knows. The last four are what tuning varies.
struct setting {
    const char *name;
    peer_run *run;      // NULL: its package was not there when this was built
    bool ours;          // the search around the library is of our making: shown, no bar
    double k_power;     // attempt.k_power
    bool log;           // attempt.log
    int algorithm;      // NLopt's number
    int local;          // NLopt's number of the local search
    double ftol;        // relative: of the local search
    double first_step;  // CMA-ES: sigma0 in genes; cminpack: lmder's factor
    bool polish;        // CRS2, CMA-ES: end with the local search from the best point
    int population;     // CRS2, CMA-ES; points a round (MLSL); random points tried (cminpack)
    int effort;         // evaluations without a gain that end a run (MLSL, CRS2); of the points
                        // tried, how many are polished (cminpack)
    double method_ftol; // CMA-ES: flatness that ends it
    int restarts;       // runs in a row without a gain that end it all; 0: there is one run
};

// NLopt's local search from the best point of the run, where the setting asks for it.
void peer_polish(struct attempt *a, const struct setting *s);

peer_run peer_gonio, peer_nlopt, peer_cminpack, peer_cmaes;

enum { SETTINGS_MAX = 24 };

// Tuned for the time to the optimum, where runs are begun anew until it is reached; and for the
// cheapest stop of their own that finds it in 99 % of fits: a ladder of settings each. gonio comes
// first; it has nothing to tune. Return how many.
int settings_to_optimum(struct setting ret_setting[SETTINGS_MAX]);
int settings_to_stop(struct setting ret_setting[SETTINGS_MAX]);

// What tuning for a stop tries: the i-th setting of a method of settings_to_stop; false: no more.
bool settings_grid(const struct setting *method, int i, struct setting *ret_setting);
