// SPDX-License-Identifier: MIT
#include "drivers/link_stats.h"

#include <math.h>

static const double bounds_s[LINK_BUCKETS] = {
    1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2,
    2e-2, 5e-2, 0.1,  0.2,  0.5,  1.0,  2.0,  5.0,  10.0, (double)INFINITY};

const char *link_error_name(enum link_error kind)
{
    static const char *const names[LINK_ERRORS] = {
        [LINK_SILENT] = "silent",   [LINK_GARBLED] = "garbled", [LINK_MISFIT] = "misfit",
        [LINK_REFUSED] = "refused", [LINK_ECHO] = "echo",       [LINK_STRAY] = "stray",
        [LINK_HUNG_UP] = "hung-up",
    };
    return names[kind];
}

double link_stats_bound_s(int bucket)
{
    return bounds_s[bucket];
}

void link_stats_answer(struct link_stats *s, int64_t latency_ns)
{
    int bucket = 0;
    while ((double)latency_ns > bounds_s[bucket] * 1e9)
        bucket++;
    s->answers[bucket]++;
    s->latency_sum_ns += latency_ns;
    s->latency_last_ns = latency_ns;
    if (latency_ns > s->latency_worst_ns)
        s->latency_worst_ns = latency_ns;
}

uint64_t link_stats_answers(const struct link_stats *s)
{
    uint64_t sum = 0;
    for (int i = 0; i < LINK_BUCKETS; i++)
        sum += s->answers[i];
    return sum;
}

uint64_t link_stats_failures(const struct link_stats *s)
{
    uint64_t sum = 0;
    for (int i = 0; i < LINK_ERRORS; i++)
        sum += s->errors[i];
    return sum;
}

double link_stats_quantile_s(const struct link_stats *s, double q)
{
    const double worst_s = (double)s->latency_worst_ns * 1e-9;
    const double rank = q * (double)link_stats_answers(s);
    double below = 0.0;
    for (int i = 0; i < LINK_BUCKETS; i++) {
        const double inside = (double)s->answers[i];
        if (inside > 0 && below + inside >= rank) {
            const double low_s = i ? bounds_s[i - 1] : 0.0, high_s = fmin(bounds_s[i], worst_s);
            return low_s + (high_s - low_s) * (rank - below) / inside;
        }
        below += inside;
    }
    return (double)NAN;
}
