// SPDX-License-Identifier: MIT
// A data set compiled for evaluation: the geometry of every reading computed once, weights
// multiplied in, as structure of arrays. Made once a fit; owns its memory; read-only afterwards, so
// any thread.
//
// Readings at the same geometry are one row of `distinct`, at their weighted mean: for the sums of
// eq. 17, sum g (f - m)^2 = G (mean f - m)^2 + sum g (f - mean f)^2 with G = sum g, and the last
// term is a constant, `scatter`. N readings at M geometries so cost M evaluations in a search.
// Whatever is said of single readings (residuals, chi2, their noise) comes from `all`.
#pragma once
#include "fit/control.h"
#include "fit/fit.h"
#include "model/batch.h"

#include <stdint.h>

#define SET_LANES BATCH_PAD // arrays are padded to a multiple of this with rows of weight zero

// The specular factor of the channels (model/channel.h), in this order.
enum set_channel { SET_SS, SET_PP, SET_RE, SET_IM, SET_CHANNELS };

// sqrt(g) is multiplied into spec, channel, diffuse, f and u: sums of squares of these are the sums
// of eq. 17. g is scaled so that its largest value is 1, which changes no Delta and cannot
// overflow.
struct set_rows {
    size_t count;
    size_t padded;                 // length of the arrays
    double *tan2_theta, *cos_beta; // of the facet
    double *spec;                  // sqrt(g) A
    double *diffuse;               // sqrt(g) w_kd / cos theta_i, or sqrt(g) w_kd / pi
    double *channel[SET_CHANNELS]; // sqrt(g) A w_ss, ...; NULL when all readings are unpolarised
    double *root_g;                // sqrt(g)
    double *f;                     // sqrt(g) f
};

enum { SET_MEMORY = 4 };

struct fit_set {
    struct set_rows all, distinct; // the same arrays where nothing is repeated
    uint32_t *row;                 // in distinct, of each reading; NULL where nothing is repeated
    double *u;                     // sqrt(g) u of all; NULL when the uncertainties are not known
    double g_scale;                // what g was divided by
    double ff;                     // sum of f^2 over all
    double scatter;                // of repeated readings about their means: sum g (f - mean f)^2
    enum batch_level level;        // that evaluates it: the best there is; tests set another one
    size_t count, padded;          // of all
    void *memory[SET_MEMORY];
};

// Checks and compiles: 0 or a negative fit_stop. ret_set is released with set_free.
int set_compile(const struct fit_data *data, const struct fit_options *options,
                struct fit_control *control, struct fit_set *ret_set);

// `count` distinct rows drawn without replacement in their order, reproducibly for the seed: a
// smaller set to search on, without u. 0 or a negative fit_stop.
int set_sample(const struct fit_set *set, size_t count, uint64_t seed, struct fit_control *control,
               struct fit_set *ret_set);

// A set with measured values of its own and everything else borrowed from `set`, which must outlive
// it; the values are those of `set` until the caller changes ret_set->all.f (sqrt(g) f, `count` of
// them) and calls set_revalue. 0 or FIT_E_MEMORY.
int set_replica(const struct fit_set *set, struct fit_set *ret_set);

// Brings what follows from all.f (distinct.f, scatter, ff) up to date. 0 or FIT_E_CANCELED.
int set_revalue(struct fit_set *set, struct fit_control *control);

void set_free(struct fit_set *set); // an all-zero set is fine
