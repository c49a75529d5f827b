// SPDX-License-Identifier: MIT
// Keep-outs: polygons in (theta_i, theta_r) that the bench must not enter, and ways round them.
// Pure, any thread.
//
// Times are not trusted. Axes that start together do not: their commands leave one after the other
// and one whose answer was lost is repeated later; an axis may stop, be sought again, or come round
// to take up its play. So a stage of a move is clear only when no combination of the positions that
// its axes pass touches a keep-out or comes within KEEPOUT_MARGIN_DEG of it. When all axes together
// are not clear, one after the other may be: then the way is a straight line for each. And where
// that does not help either, one of the bench's stations may lead round, or one axis that first
// steps aside to an end of its travel: from there it is tried again.
#pragma once
#include "base/err.h"
#include "campaign/bench.h"

#include <stdbool.h>

#define KEEPOUT_MARGIN_DEG 0.1

// The keep-out that a place lies in, its margin included; -1: none.
int keepout_at(const struct bench_config *b, double theta_i, double theta_r);

// The same for all places that the axes can reach while each is between low and high (of the
// bench's axes; those that take no part in the angles do not matter). Never misses one; may name
// one that is up to half the margin farther away.
int keepout_within(const struct bench_config *b, const struct kinematics *k,
                   const double low[BENCH_AXES], const double high[BENCH_AXES]);

// A move in stages: in each the axes of its mask, bit i for the bench's axis i, move together to
// their places in to[] (NAN: where it is).
struct keepout_way {
    int stages;
    struct keepout_stage {
        unsigned axes;
        double to[BENCH_AXES];
    } stage[2 * BENCH_AXES];
};

// From where all axes stand to where they shall (NAN: where it is). Axes that are not known, NAN,
// and steer the angles make it GON_E_INPUT, as does a way that is not to be found; the text says
// what is in the way and from where to where.
int keepout_find_way(const struct bench_config *b, const struct kinematics *k,
                     const double from[BENCH_AXES], const double to[BENCH_AXES],
                     struct keepout_way *ret_way, struct gon_error *err);
