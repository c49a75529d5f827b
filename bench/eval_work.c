// SPDX-License-Identifier: MIT
#include "bench/eval_work.h"

#include "bench/eval_divider.h"
#include "bench/naive.h"
#include "bench/report.h"
#include "fit/kernel.h"
#include "fit/passes.h"
#include "fit/rng.h"
#include "fit/space.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

const struct brdf_params eval_paint = {1.5, 0.3, 0.15, 0.9, 0.1};

void *eval_must(void *memory)
{
    if (memory)
        return memory;
    fprintf(stderr, "eval: out of memory\n");
    exit(1);
}

// --- directions ----------------------------------------------------------------------------------
static struct directions directions_new(size_t room)
{
    double *m = eval_must(calloc(4 * room, sizeof *m));
    return (struct directions){0, m, m + room, m + 2 * room, m + 3 * room};
}

void directions_free(struct directions *d)
{
    free(d->theta_i);
}

static void add(struct directions *d, double theta_i_rad, double theta_r_signed_rad)
{
    size_t i = d->count++;
    d->theta_i[i] = theta_i_rad;
    d->theta_r[i] = fabs(theta_r_signed_rad);
    d->dphi[i] = theta_r_signed_rad < 0 ? 0 : PI;
    d->f[i] = 0.1 + 0.001 * (double)(i % 97);
}

// Every 2.5 deg, and every 0.5 deg within 5 deg of specular.
struct directions directions_paper(void)
{
    static const int theta_i_deg[] = {0, 5, 10, 20, 30, 40, 45, 50, 55, 60};
    struct directions d = directions_new(1000);
    for (size_t s = 0; s < sizeof theta_i_deg / sizeof theta_i_deg[0]; s++)
        for (int half_deg = -170; half_deg <= 170; half_deg++)
            if (half_deg % 5 == 0 || abs(half_deg - 2 * theta_i_deg[s]) <= 10)
                add(&d, theta_i_deg[s] * PI / 180, half_deg * PI / 360);
    return d;
}

struct directions directions_random(size_t count, size_t distinct)
{
    struct directions d = directions_new(count);
    struct rng rng;
    rng_seed(&rng, 1);
    for (size_t i = 0; i < count; i++) {
        size_t from = i % distinct;
        if (i < distinct)
            add(&d, 1.3 * rng_uniform(&rng), 3 * rng_uniform(&rng) - 1.5);
        else
            add(&d, d.theta_i[from], d.dphi[from] > 0 ? d.theta_r[from] : -d.theta_r[from]);
    }
    return d;
}

// --- tasks ---------------------------------------------------------------------------------------
void task_naive(const struct task *t)
{
    const struct directions *d = t->directions;
    for (size_t i = 0; i < d->count; i++)
        t->column[0][i] = naive_f00(d->theta_i[i], d->theta_r[i], d->dphi[i], &eval_paint);
}

void task_trimmed(const struct task *t)
{
    const struct directions *d = t->directions;
    for (size_t i = 0; i < d->count; i++)
        t->column[0][i] = naive_f00_trimmed(d->theta_i[i], d->theta_r[i], d->dphi[i], &eval_paint);
}

void task_f00(const struct task *t)
{
    batch_f00(t->batch, t->level, &eval_paint, t->column[0]);
}

void task_jacobian(const struct task *t)
{
    batch_jacobian(t->batch, t->level, &eval_paint, t->column);
}

typedef bool pass(const struct fit_set *set, const double x[FIT_PARAMS],
                  struct fit_control *control, struct kernel_gram *ret_gram);

static void run_pass(const struct task *t, pass *sums)
{
    struct fit_control control = {.stop = false};
    struct kernel_gram gram;
    double x[FIT_PARAMS];
    space_of_params(&eval_paint, x);
    sums(&t->set, x, &control, &gram);
}

void task_moments(const struct task *t)
{
    run_pass(t, passes_moments);
}

void task_gram(const struct task *t)
{
    run_pass(t, passes_gram);
}

struct fit_set set_of(const struct directions *d, enum batch_level level, bool polarised)
{
    unsigned char *state = eval_must(malloc(d->count));
    memset(state, polarised ? BRDF_STATE_S : BRDF_STATE_U, d->count);
    const struct fit_data data = {.count = d->count,
                                  .theta_i_rad = d->theta_i,
                                  .theta_r_rad = d->theta_r,
                                  .dphi_rad = d->dphi,
                                  .f_per_sr = d->f,
                                  .pol_in = state};
    struct fit_options o = fit_options_default();
    struct fit_control control = {.stop = false};
    struct fit_set set;
    if (set_compile(&data, &o, &control, &set))
        eval_must(NULL);
    set.level = level;
    free(state);
    return set;
}

void tasks_take_turns(struct task *t, int count, int rounds)
{
    for (int i = 0; i < count; i++)
        t[i].best_ns = (double)INFINITY;
    for (int round = 0; round < rounds; round++)
        for (int i = 0; i < count; i++) {
            double from_ns = report_now_ns();
            for (int r = 0; r < t[i].repeat; r++)
                t[i].run(&t[i]);
            double ns = (report_now_ns() - from_ns) / t[i].repeat;
            t[i].best_ns = fmin(t[i].best_ns, ns / (double)t[i].directions->count);
        }
}

// --- the divider ---------------------------------------------------------------------------------
static size_t divide(enum batch_level level, double *ret_sink)
{
    enum { ROUNDS = 2000 };
#ifdef __x86_64__
    if (level == BATCH_AVX512)
        return divider_avx512(ROUNDS, ret_sink);
    if (level == BATCH_AVX2)
        return divider_avx2(ROUNDS, ret_sink);
#endif
    (void)level;
    return divider_plain(ROUNDS, ret_sink);
}

double divider_ns(enum batch_level level)
{
    double best_ns = (double)INFINITY, sink = 0;
    for (int round = 0; round < 50; round++) {
        double from_ns = report_now_ns();
        size_t points = divide(level, &sink);
        best_ns = fmin(best_ns, (report_now_ns() - from_ns) / (double)points);
    }
    return sink > 0 ? best_ns : (double)NAN;
}
