// SPDX-License-Identifier: MIT
#include "fit/paper_ga.h"

#include "fit/passes.h"
#include "fit/pool.h"
#include "fit/rng.h"

#include <stdlib.h>
#include <string.h>

enum { BATCH = 10 }; // individuals of a thread's turn

struct chromosome {
    uint32_t gene[FIT_PARAMS]; // `bits` each: n, k, sigma, ks, kd
    double delta;
};

struct ga {
    const struct fit_set *set;
    const struct fit_paper_options *o;
    struct fit_control *control;
    struct rng rng;
    double lower[FIT_PARAMS], upper[FIT_PARAMS]; // of the parameters themselves: k, not k^2
    struct chromosome *now, *next;
    double *wheel; // running sum of fitness
    struct chromosome best; // ever
};

static void decode(const struct ga *ga, const struct chromosome *c, double x[FIT_PARAMS])
{
    double value[FIT_PARAMS], last = (double)((1u << ga->o->bits) - 1);
    for (int g = 0; g < FIT_PARAMS; g++)
        value[g] = ga->lower[g] + (ga->upper[g] - ga->lower[g]) * (c->gene[g] / last);
    space_of_params(&(struct brdf_params){value[FIT_N], value[FIT_K], value[FIT_SIGMA],
                                          value[FIT_KS], value[FIT_KD]}, x);
}

static bool evaluate_batch(void *ctx, int index, struct fit_control *control)
{
    struct ga *ga = ctx;
    for (int i = BATCH * index; i < BATCH * (index + 1) && i < ga->o->population; i++) {
        double x[FIT_PARAMS];
        struct kernel_gram gram;
        decode(ga, &ga->now[i], x);
        if (!passes_moments(ga->set, x, control, &gram))
            return false;
        ga->now[i].delta = gram.m[KERNEL_R][KERNEL_R] / ga->set->ff;
    }
    return true;
}

static const struct chromosome *fittest(const struct ga *ga)
{
    const struct chromosome *best = &ga->now[0];
    for (int i = 1; i < ga->o->population; i++)
        if (ga->now[i].delta < best->delta)
            best = &ga->now[i];
    return best;
}

// All individuals of `now`, in any order and on any thread.
static bool evaluate(struct ga *ga)
{
    if (!pool_run(ga->control, (ga->o->population + BATCH - 1) / BATCH, evaluate_batch, ga))
        return false;
    const struct chromosome *best = fittest(ga);
    if (best->delta < ga->best.delta)
        ga->best = *best;
    return true;
}

static double fitness(const struct chromosome *c)
{
    return 1 / (c->delta + 1e-300);
}

// Scaling 1 is Goldberg's: a straight line that keeps the mean and lifts the best to twice the
// mean.
static void spin_up(struct ga *ga)
{
    double sum = 0, best = 0;
    for (int i = 0; i < ga->o->population; i++) {
        sum += fitness(&ga->now[i]);
        best = fmax(best, fitness(&ga->now[i]));
    }
    double mean = sum / ga->o->population, slope = 1, offset = 0;
    if (ga->o->scaling == FIT_SCALING_LINEAR && best > mean) {
        slope = mean / (best - mean);
        offset = mean * (1 - slope);
    }
    double running = 0;
    for (int i = 0; i < ga->o->population; i++)
        ga->wheel[i] = running += fmax(0, slope * fitness(&ga->now[i]) + offset);
}

static const struct chromosome *spin(struct ga *ga)
{
    int low = 0, high = ga->o->population - 1;
    double at = rng_uniform(&ga->rng) * ga->wheel[high];
    while (low < high) {
        int mid = (low + high) / 2;
        if (ga->wheel[mid] > at)
            high = mid;
        else
            low = mid + 1;
    }
    return &ga->now[low];
}

// Swaps all bits from a random place of the whole string on.
static void cross(struct ga *ga, struct chromosome *a, struct chromosome *b)
{
    int bits = ga->o->bits;
    int at = 1 + (int)rng_below(&ga->rng, (uint64_t)(bits * FIT_PARAMS - 1));
    for (int g = 0; g < FIT_PARAMS; g++) {
        int from = at - g * bits; // this gene's bits before it stay, most significant first
        uint32_t stay = from <= 0 ? 0 : from >= bits ? UINT32_MAX : ~0u << (bits - from);
        uint32_t swap = (a->gene[g] ^ b->gene[g]) & ~stay;
        a->gene[g] ^= swap;
        b->gene[g] ^= swap;
    }
}

static void flip(struct chromosome *c, int gene, int bit)
{
    c->gene[gene] ^= 1u << bit;
}

static void mutate(struct ga *ga, struct chromosome *c)
{
    if (ga->o->mutation == FIT_MUTATE_INDIVIDUAL) {
        if (rng_uniform(&ga->rng) < ga->o->pm) {
            int gene = (int)rng_below(&ga->rng, FIT_PARAMS);
            flip(c, gene, (int)rng_below(&ga->rng, (uint64_t)ga->o->bits));
        }
        return;
    }
    for (int g = 0; g < FIT_PARAMS; g++)
        for (int bit = 0; bit < ga->o->bits; bit++)
            if (rng_uniform(&ga->rng) < ga->o->pm)
                flip(c, g, bit);
}

static bool generation(struct ga *ga)
{
    struct chromosome elite = *fittest(ga);
    spin_up(ga);
    for (int i = 0; i < ga->o->population; i += 2) {
        struct chromosome *pair = &ga->next[i];
        pair[0] = *spin(ga);
        pair[1] = *spin(ga);
        if (rng_uniform(&ga->rng) < ga->o->pc)
            cross(ga, &pair[0], &pair[1]);
        mutate(ga, &pair[0]);
        mutate(ga, &pair[1]);
    }
    if (ga->o->elitism)
        ga->next[0] = elite;
    struct chromosome *swap = ga->now;
    ga->now = ga->next;
    ga->next = swap;
    return evaluate(ga);
}

static bool populate(struct ga *ga)
{
    for (int i = 0; i < ga->o->population; i++)
        for (int g = 0; g < FIT_PARAMS; g++)
            ga->now[i].gene[g] = (uint32_t)(rng_next(&ga->rng) >> (64 - ga->o->bits));
    return evaluate(ga);
}

static void trace(const struct ga *ga, const struct fit_options *o, int number)
{
    if (!o->trace)
        return;
    double sum = 0;
    for (int i = 0; i < ga->o->population; i++)
        sum += ga->now[i].delta;
    o->trace(o->trace_ctx, number, fittest(ga)->delta, sum / ga->o->population);
}

int paper_ga_search(const struct fit_set *set, const struct fit_space *space,
                    const struct fit_options *options, struct fit_control *control,
                    struct fit_optimum *ret_optimum)
{
    struct ga ga = {.set = set, .o = &options->paper, .control = control};
    size_t size = (size_t)ga.o->population;
    struct chromosome *memory = calloc(size, 2 * sizeof *memory);
    ga.wheel = calloc(size, sizeof *ga.wheel);
    ga.now = memory;
    ga.next = memory ? memory + size : NULL;
    ga.best.delta = (double)INFINITY;
    rng_seed(&ga.rng, options->seed);
    for (int i = 0; i < FIT_PARAMS; i++) {
        ga.lower[i] = i == FIT_K       ? sqrt(space->lower[i])
                      : i == FIT_SIGMA ? exp(space->lower[i])
                                       : space->lower[i];
        ga.upper[i] = i == FIT_K       ? sqrt(space->upper[i])
                      : i == FIT_SIGMA ? exp(space->upper[i])
                                       : space->upper[i];
    }
    int stop = memory && ga.wheel ? FIT_E_CANCELED : FIT_E_MEMORY;
    if (stop == FIT_E_MEMORY || !populate(&ga))
        goto out;
    trace(&ga, options, 0);
    for (int i = 1; i <= ga.o->generations; i++) {
        if (!generation(&ga))
            goto out;
        trace(&ga, options, i);
    }
    decode(&ga, &ga.best, ret_optimum->x);
    ret_optimum->q = ga.best.delta * set->ff;
    stop = 0;
out:
    free(memory);
    free(ga.wheel);
    return stop;
}
