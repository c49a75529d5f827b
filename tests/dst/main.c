// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
// Deterministic simulation: the product's engine, drivers, libmodbus and SQLite against simulated
// instruments, byte by byte and in virtual time, from a seed.
//
//   dst [--seeds A..B] [--readings N]     each seed twice: no rule broken, and the same trace twice
//   dst --seed S [--readings N] --trace   one seed; every byte and state on stdout
#include "tests/dst/matrix.h"

#include "base/options.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

struct arguments {
    const char *seeds;
    char *profiles;
    long seed, readings;
    double faults;
    bool trace, once, matrix, mutations;
    long row;
};

static double cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int run_seed(const struct arguments *a, uint64_t seed)
{
    struct trial_spec spec = {
        .seed = seed, .readings = (int)a->readings, .profiles = a->profiles,
        .faults_per_1000 = a->faults, .fault = -1,
        .trace = a->trace ? stdout : NULL};
    struct trial_result r, again;
    const double begin_s = cpu_s();
    trial_run(&spec, &r);
    const double s = cpu_s() - begin_s;
    spec.trace = NULL;
    if (!a->once)
        trial_run(&spec, &again);
    const bool same = a->once || (r.hash == again.hash && r.dump == again.dump);
    printf("%6" PRIu64 " %7d rows %7.2f h %6.2f s %4d faults %4d pauses %016" PRIx64 " %016" PRIx64
           " gap %.0f ms %-8s %s%s%s\n",
           seed, r.rows, r.virtual_s / 3600, s, r.faults, r.pauses, r.hash, r.dump,
           (double)r.worst_gap_ns * 1e-6, run_state_name(r.state), r.bench,
           same ? "" : "; NOT THE SAME TWICE", r.violations ? "; BROKEN: " : "");
    if (r.violations)
        printf("       %s (and %d more)\n", r.text, r.violations - 1);
    fflush(stdout);
    return !same || r.violations;
}

int main(int argc, char **argv)
{
    struct arguments a = {.seeds = "1..5", .readings = 300, .faults = 15, .row = -1};
    const struct option_row rows[] = {
        {"--seeds", OPTION_TEXT, offsetof(struct arguments, seeds), "A..B", 0, 0, "which"},
        {"--seed", OPTION_INT, offsetof(struct arguments, seed), "N", 0, 1e9, "only this one"},
        {"--readings", OPTION_INT, offsetof(struct arguments, readings), "N", 4, 1e6, "points each"},
        {"--faults", OPTION_REAL, offsetof(struct arguments, faults), "N", 0, 1000, "of 1000 readings"},
        {"--trace", OPTION_FLAG, offsetof(struct arguments, trace), NULL, 0, 0, "every byte"},
        {"--once", OPTION_FLAG, offsetof(struct arguments, once), NULL, 0, 0,
         "do not run each a second time"},
        {"--matrix", OPTION_FLAG, offsetof(struct arguments, matrix), NULL, 0, 0,
         "each fault in each state instead"},
        {"--mutations", OPTION_FLAG, offsetof(struct arguments, mutations), NULL, 0, 0,
         "defects put in on purpose instead, which must be reported"},
        {"--row", OPTION_INT, offsetof(struct arguments, row), "N", -1, 100, "only that one"},
        {0}};
    struct gon_error err;
    char folder[] = "/tmp/gonio-dst-XXXXXX", *end;
    a.profiles = realpath("configs", NULL); // run from the repository's root, as the other tests
    if (options_take(argc, argv, rows, &a, NULL, 0, &err) < 0) {
        fprintf(stderr, "dst: %s\n", err.text);
        return 2;
    }
    uint64_t first = strtoull(a.seeds, &end, 10), last = first;
    if (strncmp(end, "..", 2) == 0)
        last = strtoull(end + 2, NULL, 10);
    if (a.seed)
        first = last = (uint64_t)a.seed;
    if (!a.profiles || !mkdtemp(folder) || chdir(folder) < 0) {
        perror(folder);
        return 2;
    }
    int failed = 0;
    if (a.matrix) {
        const int bad = matrix_run(a.profiles, (int)a.row, stdout);
        printf("dst: %d cells of the matrix failed\n", bad);
        return bad != 0;
    }
    if (a.mutations) {
        const int missed = mutation_run_all(a.profiles, stdout);
        printf("dst: %d mutations were not reported\n", missed);
        return missed != 0;
    }
    for (uint64_t seed = first; seed <= last; seed++)
        failed += run_seed(&a, seed);
    if (chdir("/") == 0)
        rmdir(folder);
    printf("dst: %d of %" PRIu64 " seeds failed\n", failed, last - first + 1);
    free(a.profiles);
    return failed != 0;
}
