// SPDX-License-Identifier: MIT
#include "bench/peers/score.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define REACHED 1e-6 // relative to the best known Delta
#define LIMIT_MS 1000

bool score_new(struct score *ret_score, const struct setting *s, int attempts)
{
    *ret_score = (struct score){.setting = s, .ms = calloc((size_t)attempts, sizeof(double))};
    return ret_score->ms != NULL;
}

void score_free(struct score *s)
{
    free(s->ms);
}

void score_attempt(struct score *s, const struct task *t, uint64_t seed, bool to_optimum)
{
    const struct setting *set = s->setting;
    struct attempt a = {.task = t,
                        .log = set->log,
                        .k_power = set->k_power,
                        .target = t->best * (1 + REACHED),
                        .stop_at_target = to_optimum,
                        .limit_ms = LIMIT_MS};
    attempt_begin(&a);
    for (int run = 0, idle = 0; !a.done && (run == 0 || to_optimum || idle < set->restarts);
         run++) {
        double before = a.best;
        attempt_run(&a, 0);
        set->run(&a, set, seed * 1000 + (uint64_t)run);
        idle = a.best < before * (1 - ATTEMPT_GAIN) ? 0 : idle + 1;
        a.done = a.done || (to_optimum && a.hit) || attempt_spent_ms(&a) > a.limit_ms;
    }
    s->ms[s->count++] = to_optimum && a.hit ? a.hit_ms : attempt_spent_ms(&a);
    s->hits += a.hit;
    s->passes += (double)(a.values + a.slopes);
    s->below = fmax(s->below, 1 - a.best / t->best);
}

static int ascending(const void *a, const void *b)
{
    double p = *(const double *)a, q = *(const double *)b;
    return (p > q) - (p < q);
}

double score_quantile(struct score *s, double q)
{
    if (s->count == 0)
        return (double)NAN;
    qsort(s->ms, (size_t)s->count, sizeof *s->ms, ascending);
    return s->ms[(int)(q * (s->count - 1) + 0.5)];
}

double score_reached(const struct score *s)
{
    return (double)s->hits / s->count;
}

void score_title(const char *what, int tasks, uint64_t seed, int seeds)
{
    fprintf(stderr, "\n%s: %d surfaces from seed %llu, %d seeds each\n", what, tasks,
            (unsigned long long)seed, seeds);
    fprintf(stderr, "  %-33s %-10s %9s %9s %9s %7s %8s\n", "", "setting", "reached", "median ms",
            "p95 ms", "passes", "/ gonio");
}

// A method's numbers as they stand in the table.
static void setting_text(const struct setting *s, char *text, size_t size)
{
    if (s->population == 0)
        snprintf(text, size, "-");
    else
        snprintf(text, size, "%d/%d/%d", s->population, s->effort, s->restarts);
}

void score_report(const char *what, struct score *s, double gonio_ms)
{
    char setting[32];
    const char *name = s->setting->name;
    setting_text(s->setting, setting, sizeof setting);
    printf("{\"bench\":\"peers\",\"what\":\"%s, %s %s\",\"unit\":\"ms\",", what, name, setting);
    if (s->count == 0) {
        fprintf(stderr, "  %-33s %-10s not measured: its package is missing\n", name, setting);
        printf("\"value\":null}\n");
        return;
    }
    double median = score_quantile(s, 0.5), p95 = score_quantile(s, 0.95);
    double passes = s->passes / s->count, reached = score_reached(s), ratio = median / gonio_ms;
    fprintf(stderr, "  %-33s %-10s %7.2f %% %9.3f %9.3f %7.0f %8.2f\n", name, setting,
            100 * reached, median, p95, passes, ratio);
    printf(
        "\"value\":%.4g,\"p95_ms\":%.4g,\"reached\":%.4f,\"passes\":%.1f,\"times_gonio\":%.4g}\n",
        median, p95, reached, passes, ratio);
    if (s->below > ATTEMPT_GAIN)
        fprintf(stderr, "  %s: a Delta %.1g below the best known\n", name, s->below);
}

// The first word: "NLopt MLSL + SLSQP" and "NLopt CRS2_LM + SLSQP" are of one.
static bool of_one_library(const struct setting *a, const struct setting *b)
{
    const size_t n = strcspn(a->name, " ");
    return strcspn(b->name, " ") == n && !strncmp(a->name, b->name, n);
}

// "the fastest of NLopt and pagmo that reaches 99 %, ": of the libraries whose own searches were
// measured; nothing where there is one only.
static void compared_text(const struct score *s, int count, double reached, char *text, size_t size)
{
    const struct setting *last = NULL;
    size_t length = 0;
    *text = 0;
    for (int i = 0; i < count && count > 1; i++) {
        const struct setting *now = s[i].setting;
        if (s[i].count == 0 || now->ours || (last && of_one_library(last, now)))
            continue;
        length += (size_t)snprintf(text + length, size - length, "%s%.*s",
                                   last ? " and " : "the fastest of ",
                                   (int)strcspn(now->name, " "), now->name);
        assert(length < size);
        last = now;
    }
    if (last && reached > 0)
        length += (size_t)snprintf(text + length, size - length, " that reaches %g %%",
                                   100 * reached);
    if (last)
        snprintf(text + length, size - length, ", ");
}

void score_summary(const char *what, struct score *s, int count, double reached, double gonio_ms,
                   double bar)
{
    const char *name = NULL;
    char compared[200];
    double fastest = (double)INFINITY;
    for (int i = 0; i < count; i++) {
        bool counts = s[i].count > 0 && score_reached(&s[i]) >= reached && !s[i].setting->ours;
        if (counts && score_quantile(&s[i], 0.5) < fastest) {
            fastest = score_quantile(&s[i], 0.5);
            name = s[i].setting->name;
        }
    }
    compared_text(s, count, reached, compared, sizeof compared);
    printf("{\"bench\":\"peers\",\"what\":\"%s, gonio\",\"value\":%.4g,\"unit\":\"ms\",", what,
           gonio_ms);
    if (name) {
        printf("\"ratio\":%.4g,\"against\":\"%s\",", fastest / gonio_ms, name);
        fprintf(stderr, "  %s%s%s takes %.2f times as long as gonio (bar: %g)\n", compared, name,
                *compared ? "," : "", fastest / gonio_ms, bar);
    } else {
        fprintf(stderr, "  no peer was measured%s\n",
                reached > 0 ? " that succeeds often enough" : "");
    }
    printf("\"bar\":%g}\n", bar);
    fflush(stdout);
}
