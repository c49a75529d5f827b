// SPDX-License-Identifier: MIT
// A fit with the reduction that it is a fit of, on its way from the fit thread to the store thread.
#pragma once
#include "campaign/fitjson.h"
#include "campaign/reduce.h"

struct fit_outcome {
    struct reduction reduction;
    struct fit_record record; // its trace is the outcome's
    char *trace;
};

void fit_outcome_free(void *outcome); // NULL is fine
