// SPDX-License-Identifier: MIT
// An invented instrument with one value of every kind, for the tests of what profiles say.
#pragma once
#include "drivers/profile_data.h"

#include <stdlib.h>
#include <string.h>

enum { // its values
    S_X,
    S_COUNT,
    S_STATUS,
    S_MODEL,
    S_STATE,
    S_TAU,
    S_LEVEL,
    S_MODE,
    S_CURRENT,
    S_PERIOD,
    S_UNKNOWN
};

static inline struct profile *profile_sample(void)
{
    static const struct profile sample =
        {
            .name = "sample",
            .values_count = S_UNKNOWN + 1,
            .values =
                {
                    [S_X] = {.name = "x", .unit = "V", .scale = 1},
                    [S_COUNT] = {.name = "count", .type = PROFILE_INT, .scale = 1, .max = 100},
                    [S_STATUS] = {.name = "status",
                                  .type = PROFILE_HEX,
                                  .scale = 1,
                                  .bits = {{"fault", 0, ""}, {"on", 1, ""}, {"key_off", 31, ""}},
                                  .bits_count = 3},
                    [S_MODEL] = {.name = "model", .type = PROFILE_STRING},
                    [S_STATE] = {.name = "state",
                                 .type = PROFILE_WORD,
                                 .words = {"OFF", "ON", "ONCE", "no head"},
                                 .words_count = 4},
                    [S_TAU] = {.name = "tau_s",
                               .unit = "s",
                               .scale = 1,
                               .ladder = {1e-5, 3e-5, 1e-4, 3, 1},
                               .ladder_count = 5},
                    [S_LEVEL] = {.name = "level_w",
                                 .unit = "W",
                                 .scale = 1e-3,
                                 .max = 0.5,
                                 .resolution = 1e-4},
                    [S_MODE] =
                        {.name = "mode",
                         .type = PROFILE_INT,
                         .scale = 1,
                         .max =
                             9,
                         .words = {"warming", "ready"},
                         .words_count = 2,
                         .ladder_first = 3},
                    [S_CURRENT] = {.name = "current_a",
                                   .unit = "A",
                                   .scale = 1,
                                   .over = {9.9e37},
                                   .over_count = 1,
                                   .invalid = {9.91e37},
                                   .invalid_count = 1},
                    [S_PERIOD] = {.name = "rate_hz", .scale = 1e6, .inverse = true},
                    [S_UNKNOWN] = {.name = "unheard", .scale = 1},
                },
        };
    struct profile *p = malloc(sizeof *p);
    if (p)
        memcpy(p, &sample, sizeof *p);
    return p;
}
