// SPDX-License-Identifier: MIT
// What a bench program prints: one JSON object a line on stdout, which scripts/bench collects into
// build/bench.json and a table. Times are the least of many rounds, in which everything that is
// compared takes its turn, so that a busy machine slows all of it alike.
#pragma once
#include <stdio.h>
#include <time.h>

static inline double report_now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

// ratio: how many times faster or better than `against`; `against` NULL: nothing to compare with.
// No text may hold a quotation mark or a backslash.
static inline void report_row(const char *bench, const char *what, double value, const char *unit,
                              double ratio, const char *against)
{
    printf("{\"bench\":\"%s\",\"what\":\"%s\",\"value\":%.6g,\"unit\":\"%s\"", bench, what, value,
           unit);
    if (against)
        printf(",\"ratio\":%.4g,\"against\":\"%s\"", ratio, against);
    printf("}\n");
    fflush(stdout);
}
