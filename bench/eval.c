// SPDX-License-Identifier: MIT
// uses: fit model
// with: naive
// What an evaluation costs: f_00 and its Jacobian at the 850 points of the paper's plan, the naive
// way and at every level this machine runs, against each other and against what the divider alone
// would take; the passes of a fit; and how these grow with the number of points. One thread.
#include "bench/eval_work.h"
#include "bench/report.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { MOST_TASKS = 32, SIZES = 4 };

static double worst_error(const struct directions *d, const double *f)
{
    double worst = 0;
    for (size_t i = 0; i < d->count; i++) {
        struct brdf_geometry g = brdf_geometry(d->theta_i[i], d->theta_r[i], d->dphi[i]);
        worst = fmax(worst, fabs(f[i] / brdf_f00(&eval_paint, BRDF_DIFFUSE_PAPER, &g) - 1));
    }
    return worst;
}

static void report_level(const struct task *t, const char *unit, double ratio, const char *against)
{
    char what[80];
    snprintf(what, sizeof what, "%s, %s", t->what, batch_level_name(t->level));
    report_row("eval", what, t->best_ns, unit, ratio, against);
}

// --- the paper's plan ----------------------------------------------------------------------------
static int paper_tasks(const struct task *like, struct task *t)
{
    const struct task each[] = {{.what = "f_00", .run = task_f00, .repeat = 50},
                                {.what = "f_00 and Jacobian", .run = task_jacobian, .repeat = 20},
                                {.what = "sums for a search", .run = task_moments, .repeat = 50},
                                {.what = "sums for a step", .run = task_gram, .repeat = 20}};
    int count = 0;
    for (int l = 0; l <= (int)batch_best_level(); l++)
        for (size_t i = 0; i < sizeof each / sizeof each[0]; i++) {
            t[count] = *like;
            t[count].what = each[i].what;
            t[count].run = each[i].run;
            t[count].repeat = each[i].repeat;
            t[count].level = (enum batch_level)l;
            t[count++].set = set_of(like->directions, (enum batch_level)l, false);
        }
    return count;
}

static void report_paper(struct task *t, int count)
{
    const double naive_ns = t[0].best_ns, trimmed_ns = t[1].best_ns;
    const struct directions *d = t[0].directions;
    report_row("eval", "f_00, naive", naive_ns, "ns/point", 1, "naive");
    report_row("eval", "f_00, naive but trimmed", trimmed_ns, "ns/point", naive_ns / trimmed_ns,
               "naive");
    for (int i = 2; i < count; i++)
        report_level(&t[i], "ns/point", naive_ns / t[i].best_ns, "naive");
    for (int i = 2; i < count; i++)
        if (t[i].run == task_f00) {
            struct task trimmed = t[i], error = t[i], share = t[i], roof = t[i];
            trimmed.what = "f_00 once more";
            report_level(&trimmed, "ns/point", trimmed_ns / t[i].best_ns, "naive but trimmed");
            task_f00(&t[i]);
            error.what = "f_00, largest relative error";
            error.best_ns = worst_error(d, t[i].column[0]);
            report_level(&error, "relative", 0, NULL);
            roof.what = "divider alone, 2 roots and 1 division";
            roof.best_ns = divider_ns(t[i].level);
            report_level(&roof, "ns/point", 0, NULL);
            share.what = "f_00, share of the divider's roofline";
            share.best_ns = 100 * roof.best_ns / t[i].best_ns;
            report_level(&share, "%", 0, NULL);
        }
}

static void paper_plan(void)
{
    struct directions d = directions_paper();
    struct batch b;
    double *column[BATCH_COLUMNS];
    if (!batch_new(d.count, d.theta_i, d.theta_r, d.dphi, BRDF_DIFFUSE_PAPER, &b))
        eval_must(NULL);
    for (int c = 0; c < BATCH_COLUMNS; c++)
        column[c] = eval_must(aligned_alloc(64, b.padded * sizeof(double)));
    const struct task like = {.directions = &d, .batch = &b, .column = column, .repeat = 1};
    struct task t[MOST_TASKS] = {like, like};
    t[0].run = task_naive;
    t[1].run = task_trimmed;
    int count = 2 + paper_tasks(&like, t + 2);
    tasks_take_turns(t, count, 300);
    report_paper(t, count);
    for (int i = 2; i < count; i++)
        set_free(&t[i].set);
    for (int c = 0; c < BATCH_COLUMNS; c++)
        free(column[c]);
    batch_free(&b);
    directions_free(&d);
}

// --- growth --------------------------------------------------------------------------------------
// What 1000 to 1,000,000 points cost each, with `distinct_share` of the directions differing.
static void growth(const char *what, void (*run)(const struct task *), bool polarised)
{
    struct directions d[SIZES];
    struct task t[SIZES];
    size_t points = 1000;
    for (int i = 0; i < SIZES; i++, points *= 10) {
        d[i] = directions_random(points, points);
        t[i] = (struct task){.what = what,
                             .run = run,
                             .directions = &d[i],
                             .repeat = points < 100000 ? (int)(100000 / points) : 1,
                             .set = set_of(&d[i], batch_best_level(), polarised)};
    }
    tasks_take_turns(t, SIZES, 30);
    for (int i = 0; i < SIZES; i++) {
        char row[80];
        snprintf(row, sizeof row, "%s, %zu points", what, d[i].count);
        report_row("eval", row, t[i].best_ns, "ns/point", t[i].best_ns / t[0].best_ns,
                   "1000 points");
        set_free(&t[i].set);
        directions_free(&d[i]);
    }
}

static void repeats(void)
{
    struct directions d[2] = {directions_random(100000, 100000), directions_random(100000, 1000)};
    struct task t[2];
    for (int i = 0; i < 2; i++)
        t[i] = (struct task){.run = task_moments,
                             .repeat = i ? 100 : 1,
                             .directions = &d[i],
                             .set = set_of(&d[i], batch_best_level(), false)};
    tasks_take_turns(t, 2, 100);
    report_row("eval", "sums for a search, 100000 readings of 1000 directions", t[1].best_ns,
               "ns/reading", t[0].best_ns / t[1].best_ns, "100000 directions");
    for (int i = 0; i < 2; i++) {
        set_free(&t[i].set);
        directions_free(&d[i]);
    }
}

int main(void)
{
    paper_plan();
    growth("sums for a search", task_moments, false);
    growth("sums for a step", task_gram, false);
    growth("polarised sums for a search", task_moments, true);
    growth("polarised sums for a step", task_gram, true);
    repeats();
    return 0;
}
