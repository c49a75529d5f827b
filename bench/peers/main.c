// SPDX-License-Identifier: MIT
// gonio's fit beside other optimisers on the paper's plan: time to the known optimum, time of a
// stop of one's own that finds it in 99 % of fits, and scipy's differential evolution. Methods take
// turns, problem by problem, so that what else the machine does hurts all alike; times are of the
// thread's CPU clock. A table goes to stderr, a JSON object a line to stdout, as from the other
// bench programs, with details added. doc/bench.md explains.
#include "bench/peers/check.h"
#include "bench/peers/scipy.h"
#include "bench/peers/score.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STARTS = 200, TUNE_TASKS = 150, TUNE_SEEDS = 2 };
#define WRONG_SLOPE 1e-4
#define SUCCESS 0.99
#define TUNE_SEED 1000000 // tuning sees other surfaces

struct bench {
    int tasks, seeds, scipy_tasks;
    uint64_t seed;
    bool tune;
    struct task *task;
};

static bool make_tasks(struct bench *b)
{
    b->task = calloc((size_t)b->tasks, sizeof *b->task);
    for (int i = 0; b->task && i < b->tasks; i++) {
        if (!task_new(&b->task[i], b->seed + (uint64_t)i, STARTS))
            return false;
        double wrong = check_slopes(&b->task[i]);
        if (!(wrong < WRONG_SLOPE)) {
            fprintf(stderr, "peers: surface %d: derivatives are off by %.2g\n", i, wrong);
            return false;
        }
    }
    return b->task != NULL;
}

static bool compare(const struct bench *b, bool to_optimum)
{
    const char *what = to_optimum ? "time to the optimum" : "stop of its own";
    struct setting setting[SETTINGS_MAX];
    struct score score[SETTINGS_MAX];
    int count = to_optimum ? settings_to_optimum(setting) : settings_to_stop(setting);
    for (int m = 0; m < count; m++)
        if (!score_new(&score[m], &setting[m], b->tasks * b->seeds))
            return false;
    for (int seed = 0; seed < b->seeds; seed++)
        for (int i = 0; i < b->tasks; i++)
            for (int m = 0; m < count; m++)
                if (setting[m].run)
                    score_attempt(&score[m], &b->task[i], b->task[i].seed * 100 + (uint64_t)seed,
                                  to_optimum);
    double gonio_ms = score_quantile(&score[0], 0.5);
    score_title(what, b->tasks, b->seed, b->seeds);
    for (int m = 0; m < count; m++)
        score_report(what, &score[m], gonio_ms);
    score_summary(what, &score[1], count - 1, to_optimum ? 0 : SUCCESS, gonio_ms,
                  to_optimum ? 1 : 2);
    for (int m = 0; m < count; m++)
        score_free(&score[m]);
    return true;
}

static bool tune_method(const struct bench *b, const struct setting *method)
{
    struct setting s;
    for (int i = 0; settings_grid(method, i, &s); i++) {
        struct score score;
        if (!score_new(&score, &s, b->tasks * TUNE_SEEDS))
            return false;
        for (int seed = 0; seed < TUNE_SEEDS; seed++)
            for (int t = 0; t < b->tasks; t++)
                score_attempt(&score, &b->task[t], b->task[t].seed * 100 + (uint64_t)seed, false);
        printf("%7.2f %% %8.3f ms  population %d, effort %d, flatness %g, restarts %d: %s\n",
               100 * score_reached(&score), score_quantile(&score, 0.5), s.population, s.effort,
               s.method_ftol, s.restarts, s.name);
        fflush(stdout);
        score_free(&score);
    }
    return true;
}

static bool tune(const struct bench *b)
{
    struct setting setting[SETTINGS_MAX];
    int count = settings_to_stop(setting);
    bool ok = true;
    for (int m = 0; ok && m < count; m++)
        if (m == 0 || strcmp(setting[m].name, setting[m - 1].name) != 0)
            ok = tune_method(b, &setting[m]);
    return ok;
}

static bool read_options(int argc, char **argv, struct bench *b)
{
    static const struct option options[] = {{"tune", no_argument, NULL, 't'},
                                            {"seed", required_argument, NULL, 's'},
                                            {NULL, 0, NULL, 0}};
    for (int o; (o = getopt_long(argc, argv, "", options, NULL)) != -1;)
        switch (o) {
        case 't':
            b->tune = true;
            b->tasks = TUNE_TASKS;
            b->seed = TUNE_SEED;
            break;
        case 's': b->seed = strtoull(optarg, NULL, 10); break;
        default: return false;
        }
    return optind == argc;
}

int main(int argc, char **argv)
{
    struct bench b = {.tasks = 60, .seeds = 10, .scipy_tasks = 12, .seed = 2026};
    const char *full = getenv("FULL");
    if (full && *full) {
        b.seeds = 30;
        b.scipy_tasks = b.tasks;
    }
    if (!read_options(argc, argv, &b)) {
        fprintf(stderr, "usage: [FULL=1] peers [--seed N] | peers --tune\n");
        return 2;
    }
    bool ok = make_tasks(&b);
    if (ok && b.tune)
        ok = tune(&b);
    else if (ok)
        ok = compare(&b, true) && compare(&b, false) && scipy_compare(b.task, b.scipy_tasks);
    for (int i = 0; b.task && i < b.tasks; i++)
        task_free(&b.task[i]);
    free(b.task);
    return ok ? 0 : 1;
}
