// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit sim model base
// Deterministic simulation: the product's engine, drivers, libmodbus and SQLite against simulated
// instruments, byte by byte and in virtual time, from a seed.
//
//   dst                                   what CI runs: everything below, in about a minute
//   dst --seeds A..B [--readings N]       each seed twice: no rule broken, and the same twice
//   dst --seed S [--readings N] --trace   one seed; every byte, fault and state on stdout
//   dst --matrix [--row N]                each fault in each state, and the reaction seen
//   dst --mutations                       defects on purpose, each of which must be reported
//   dst --regressions                     the seeds of tests/dst/regressions.txt
#include "tests/dst/matrix.h"

#include "base/options.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { CI_SEEDS = 50, CI_READINGS = 400 };

struct arguments {
    const char *seeds;
    char *profiles, *list;
    long seed, readings, row;
    double faults;
    bool trace, once, matrix, mutations, regressions;
};

static double cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void print_result(uint64_t seed, const struct trial_result *r, double s, bool same)
{
    printf("%6" PRIu64 " %7d rows %6.2f h %6.2f s %5d faults %4d pauses  trace %016" PRIx64
           " file %016" PRIx64 "  gap %.0f ms  %s, %s%s%s\n",
           seed, r->rows, r->virtual_s / 3600, s, r->faults, r->pauses, r->hash, r->dump,
           (double)r->worst_gap_ns * 1e-6, run_state_name(r->state), r->bench,
           same ? "" : "; NOT THE SAME TWICE", r->violations ? "; BROKEN:" : "");
    if (r->violations)
        printf("       %s (and %d more)\n", r->text, r->violations - 1);
    fflush(stdout);
}

static int run_seed(const struct arguments *a, uint64_t seed, int *counts)
{
    struct trial_spec spec = {.seed = seed,
                              .readings = (int)a->readings,
                              .profiles = a->profiles,
                              .faults_per_1000 = a->faults,
                              .fault = -1,
                              .trace = a->trace ? stdout : NULL};
    struct trial_result r, again;
    const double begin_s = cpu_s();
    trial_run(&spec, &r);
    const double s = cpu_s() - begin_s;
    spec.trace = NULL;
    if (!a->once && !a->trace)
        trial_run(&spec, &again);
    else
        again = r;
    const bool same = r.hash == again.hash && r.dump == again.dump;
    print_result(seed, &r, s, same);
    for (int i = 0; i < faults_count(); i++)
        counts[i] += r.counts[i];
    return !same || r.violations;
}

static int run_seeds(const struct arguments *a, uint64_t first, uint64_t last)
{
    int failed = 0, counts[TRIAL_FAULTS] = {0};
    for (uint64_t seed = first; seed <= last; seed++)
        failed += run_seed(a, seed, counts);
    printf("faults:");
    for (int i = 0; i < faults_count(); i++)
        printf("%s %s %s %d", i ? "," : "", faults[i].id, faults[i].what, counts[i]);
    printf("\ndst: %d of %" PRIu64 " seeds failed\n", failed, last - first + 1);
    return failed;
}

// A line: seed, readings, faults of 1000, and what was found.
static int run_regressions(const struct arguments *given)
{
    struct arguments a = *given;
    char line[256];
    int failed = 0, counts[TRIAL_FAULTS] = {0};
    FILE *f = fopen(a.list, "re");
    if (!f)
        return 1;
    while (fgets(line, sizeof line, f)) {
        char *end;
        const uint64_t seed = strtoull(line, &end, 10);
        if (end == line)
            continue;
        a.readings = strtol(end, &end, 10);
        a.faults = strtod(end, &end);
        failed += run_seed(&a, seed, counts);
    }
    fclose(f);
    printf("dst: %d regressions failed\n", failed);
    return failed;
}

static int run_matrix(const struct arguments *a)
{
    const int bad = matrix_run(a->profiles, (int)a->row, stdout);
    printf("dst: %d cells of the matrix failed\n", bad);
    return bad;
}

static int run_mutations(const struct arguments *a)
{
    const int missed = mutation_run_all(a->profiles, stdout);
    printf("dst: %d mutations were not reported\n", missed);
    return missed;
}

static int run_all(struct arguments *a)
{
    int failed = run_mutations(a) + run_matrix(a);
    a->once = true;
    failed += run_regressions(a);
    a->once = false;
    a->readings = CI_READINGS;
    return failed + run_seeds(a, 1, CI_SEEDS);
}

static int run(struct arguments *a)
{
    char *end;
    if (a->mutations)
        return run_mutations(a);
    if (a->matrix)
        return run_matrix(a);
    if (a->regressions)
        return run_regressions(a);
    if (a->seed)
        return run_seeds(a, (uint64_t)a->seed, (uint64_t)a->seed);
    if (!a->seeds)
        return run_all(a);
    const uint64_t first = strtoull(a->seeds, &end, 10);
    return run_seeds(a, first, strncmp(end, "..", 2) == 0 ? strtoull(end + 2, NULL, 10) : first);
}

int main(int argc, char **argv)
{
    struct arguments a = {.readings = 1000, .faults = 15, .row = -1};
    const struct option_row rows[] = {
        {"--seeds", OPTION_TEXT, offsetof(struct arguments, seeds), "A..B", 0, 0, "which"},
        {"--seed", OPTION_INT, offsetof(struct arguments, seed), "N", 0, 1e9, "only this one"},
        {"--readings", OPTION_INT, offsetof(struct arguments, readings), "N", 4, 1e6,
         "points each"},
        {"--faults", OPTION_REAL, offsetof(struct arguments, faults), "N", 0, 1000,
         "of 1000 readings"},
        {"--trace", OPTION_FLAG, offsetof(struct arguments, trace), NULL, 0, 0, "every byte"},
        {"--once", OPTION_FLAG, offsetof(struct arguments, once), NULL, 0, 0,
         "do not run each a second time"},
        {"--matrix", OPTION_FLAG, offsetof(struct arguments, matrix), NULL, 0, 0,
         "each fault in each state"},
        {"--row", OPTION_INT, offsetof(struct arguments, row), "N", -1, TRIAL_FAULTS - 1,
         "only that one of its rows, from 0"},
        {"--mutations", OPTION_FLAG, offsetof(struct arguments, mutations), NULL, 0, 0,
         "defects put in on purpose, which must be reported"},
        {"--regressions", OPTION_FLAG, offsetof(struct arguments, regressions), NULL, 0, 0,
         "seeds that once failed"},
        {0}};
    struct gon_error err;
    char folder[] = "/tmp/gonio-dst-XXXXXX";
    if (options_take(argc, argv, rows, &a, NULL, 0, &err) < 0) {
        fprintf(stderr, "dst: %s\n", err.text);
        return 2;
    }
    // Run from the repository's root, as the other tests.
    a.profiles = realpath("configs", NULL);
    a.list = realpath("tests/dst/regressions.txt", NULL);
    if (!a.profiles || !a.list || !mkdtemp(folder) || chdir(folder) < 0) {
        perror("dst: configs, tests/dst/regressions.txt or a folder in /tmp");
        return 2;
    }
    const int failed = run(&a);
    if (chdir("/") == 0)
        rmdir(folder);
    free(a.profiles);
    free(a.list);
    return failed != 0;
}
