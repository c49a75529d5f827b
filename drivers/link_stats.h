// SPDX-License-Identifier: MIT
// What one link has seen since it was opened first, kept across reopening: counters, errors by
// kind, and a histogram of how long answers took. Plain data that is copied freely; the link's
// owner writes it. Pure. Thread: any, each its own copy.
#pragma once
#include <stdint.h>

// One failed exchange counts once, by what was seen first.
enum link_error {
    LINK_SILENT,  // no answer in time
    LINK_GARBLED, // checksum, unreadable, broken off, outside what can be answered
    LINK_MISFIT,  // a sound answer of another unit, function, length or transaction
    LINK_REFUSED, // the device answered that it will not: exception, "error"
    LINK_ECHO,    // sent back what it was told
    LINK_STRAY,   // came unasked, and was dropped
    LINK_HUNG_UP, // unplugged, connection broken
    LINK_ERRORS
};

enum { LINK_BUCKETS = 20 }; // 1-2-5 from 10 us to 10 s, and one for whatever is longer

struct link_stats {
    uint64_t requests, bytes_out, bytes_in;
    uint64_t retries;  // questions that were asked again
    uint64_t resyncs;  // times the line had to fall silent, or to be reconnected, first
    uint64_t reopened; // times it came back
    uint64_t errors[LINK_ERRORS];
    uint64_t answers[LINK_BUCKETS]; // by latency, each answer in one bucket
    int64_t latency_sum_ns, latency_last_ns, latency_worst_ns;
};

const char *link_error_name(enum link_error kind); // "silent", "garbled", ...
double link_stats_bound_s(int bucket); // the longest latency it holds; INFINITY for the last

void link_stats_answer(struct link_stats *s, int64_t latency_ns); // enters one answer
uint64_t link_stats_answers(const struct link_stats *s);          // all of them
uint64_t link_stats_failures(const struct link_stats *s);         // errors of all kinds
// The latency that the share q (0..1) of answers did not exceed: linear within a bucket, never more
// than the worst seen. NAN without answers.
double link_stats_quantile_s(const struct link_stats *s, double q);
