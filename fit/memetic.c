// SPDX-License-Identifier: MIT
#include "fit/memetic.h"

#include "fit/kernel.h"
#include "fit/rng.h"
#include "fit/varpro.h"

#include <stdlib.h>

enum { GENES = 3, GENERATIONS = 6, POPULATION_MAX = 192, NICHES_MAX = 24, FINALISTS = 6, FULL = 3 };
#define FIRST_STEPS 10  // of the polish of each niche
#define LAST_STEPS 200  // of the finalists: a bound, not an expectation

struct individual {
    double gene[GENES]; // in [0, 1]
    struct fit_optimum at;
};

struct search {
    const struct fit_set *set;
    const struct fit_space *space;
    struct fit_control *control;
    struct rng rng;
    int population, niches;
    struct individual all[POPULATION_MAX];
};

static double between(double low, double high, double t)
{
    return low + (high - low) * t;
}

static bool evaluate(struct search *s, struct individual *i)
{
    const double *low = s->space->lower, *high = s->space->upper;
    double *x = i->at.x;
    double root_k = between(sqrt(sqrt(low[FIT_K])), sqrt(sqrt(high[FIT_K])), i->gene[1]);
    x[FIT_N] = between(low[FIT_N], high[FIT_N], i->gene[0]);
    x[FIT_K] = pow(root_k, 4);
    x[FIT_SIGMA] = between(low[FIT_SIGMA], high[FIT_SIGMA], i->gene[2]);
    x[FIT_KS] = x[FIT_KD] = 0;
    struct kernel_gram gram;
    if (!kernel_moments(s->set, x, s->control, &gram))
        return false;
    struct varpro v = varpro_solve(&gram, x, s->space);
    x[FIT_KS] = v.ks;
    x[FIT_KD] = v.kd;
    i->at.q = v.q;
    return true;
}

// A Latin hypercube: each gene takes each of `population` slices once.
static bool populate(struct search *s)
{
    for (int g = 0; g < GENES; g++)
        for (int i = 0; i < s->population; i++) {
            int j = (int)rng_below(&s->rng, (uint64_t)i + 1);
            double slice = (i + rng_uniform(&s->rng)) / s->population;
            s->all[i].gene[g] = s->all[j].gene[g];
            s->all[j].gene[g] = slice;
        }
    for (int i = 0; i < s->population; i++)
        if (!evaluate(s, &s->all[i]))
            return false;
    return true;
}

static double distance2(const struct individual *a, const struct individual *b)
{
    double d = 0;
    for (int g = 0; g < GENES; g++)
        d += (a->gene[g] - b->gene[g]) * (a->gene[g] - b->gene[g]);
    return d;
}

static double reflect(double t)
{
    t = fabs(fmod(t, 2));
    return t > 1 ? 2 - t : t;
}

// Two children on the line through the parents and a little beyond (blend crossover), one gene in
// two shaken.
static void breed(struct search *s, const struct individual *a, const struct individual *b,
                  struct individual child[2])
{
    for (int g = 0; g < GENES; g++) {
        double t = between(-0.25, 1.25, rng_uniform(&s->rng));
        double value[2] = {between(a->gene[g], b->gene[g], t), between(b->gene[g], a->gene[g], t)};
        for (int i = 0; i < 2; i++) {
            if (rng_next(&s->rng) >> 63)
                value[i] += 0.05 * rng_normal(&s->rng);
            child[i].gene[g] = reflect(value[i]);
        }
    }
}

static bool generation(struct search *s)
{
    for (int i = s->population - 1; i > 0; i--) { // shuffle: pairs are random
        int j = (int)rng_below(&s->rng, (uint64_t)i + 1);
        struct individual swap = s->all[i];
        s->all[i] = s->all[j];
        s->all[j] = swap;
    }
    for (int i = 0; i + 1 < s->population; i += 2) {
        struct individual *a = &s->all[i], *b = &s->all[i + 1], child[2];
        breed(s, a, b, child);
        if (!evaluate(s, &child[0]) || !evaluate(s, &child[1]))
            return false;
        if (distance2(a, &child[0]) + distance2(b, &child[1]) >
            distance2(a, &child[1]) + distance2(b, &child[0])) {
            struct individual *swap = a;
            a = b;
            b = swap;
        }
        if (child[0].at.q < a->at.q)
            *a = child[0];
        if (child[1].at.q < b->at.q)
            *b = child[1];
    }
    return true;
}

static void trace(const struct search *s, const struct fit_options *o, int number)
{
    if (!o->trace)
        return;
    double best = (double)INFINITY, sum = 0;
    for (int i = 0; i < s->population; i++) {
        best = fmin(best, s->all[i].at.q);
        sum += s->all[i].at.q;
    }
    o->trace(o->trace_ctx, number, best / s->set->ff, sum / s->population / s->set->ff);
}

static int by_q(const void *a, const void *b)
{
    double p = ((const struct individual *)a)->at.q, q = ((const struct individual *)b)->at.q;
    return (p > q) - (p < q);
}

static int by_optimum(const void *a, const void *b)
{
    double p = ((const struct fit_optimum *)a)->q, q = ((const struct fit_optimum *)b)->q;
    return (p > q) - (p < q);
}

// The best individual of each niche, best first: greedily, no two nearer than a radius that shrinks
// until enough are found.
static int pick_niches(struct search *s, struct fit_optimum *ret_niche)
{
    int picked[NICHES_MAX], count = 0;
    qsort(s->all, (size_t)s->population, sizeof s->all[0], by_q);
    for (double radius = 0.2; radius > 1e-3 && count < s->niches; radius /= 2)
        for (int i = 0; i < s->population && count < s->niches; i++) {
            bool apart = true;
            for (int j = 0; j < count && apart; j++)
                apart = distance2(&s->all[i], &s->all[picked[j]]) > radius * radius;
            if (apart)
                picked[count++] = i;
        }
    for (int i = 0; i < count; i++)
        ret_niche[i] = s->all[picked[i]].at;
    return count;
}

// Every niche a few steps, the best of them to the end. Returns how many are in order, 0 when
// canceled.
static int polish_niches(struct search *s, struct fit_optimum *niche)
{
    int count = pick_niches(s, niche);
    for (int i = 0; i < count; i++)
        if (!polish(s->set, s->space, FIRST_STEPS, s->control, &niche[i]))
            return 0;
    qsort(niche, (size_t)count, sizeof *niche, by_optimum);
    int finalists = count < FINALISTS ? count : FINALISTS;
    for (int i = 0; i < finalists; i++)
        if (!polish(s->set, s->space, LAST_STEPS, s->control, &niche[i]))
            return 0;
    qsort(niche, (size_t)finalists, sizeof *niche, by_optimum);
    return finalists;
}

// 64 individuals and 16 niches at 850 points; between 48 and 192, and 8 and 24.
static void size_search(struct search *s)
{
    double scale = sqrt(850.0 / (double)s->set->distinct.count);
    s->population = (int)fmin(POPULATION_MAX, fmax(48, 64 * scale)) / 2 * 2;
    s->niches = (int)fmin(NICHES_MAX, fmax(8, 16 * scale));
}

static bool search_set(struct search *s, const struct fit_options *o, struct fit_optimum *niche,
                       int *ret_count)
{
    size_search(s);
    if (!populate(s))
        return false;
    trace(s, o, 0);
    for (int i = 1; i <= GENERATIONS; i++) {
        if (!generation(s))
            return false;
        trace(s, o, i);
    }
    *ret_count = polish_niches(s, niche);
    return *ret_count > 0;
}

int memetic_search(const struct fit_set *set, const struct fit_space *space,
                   const struct fit_options *options, struct fit_control *control,
                   struct fit_optimum *ret_optimum)
{
    struct fit_set sample = {.count = 0};
    struct search *s = calloc(1, sizeof *s);
    int stop = s ? 0 : FIT_E_MEMORY;
    if (!stop && set->distinct.count > MEMETIC_SAMPLE)
        stop = set_sample(set, MEMETIC_SAMPLE, options->seed, control, &sample);
    if (stop)
        goto out;
    s->set = sample.count ? &sample : set;
    s->space = space;
    s->control = control;
    rng_seed(&s->rng, options->seed);
    struct fit_optimum niche[NICHES_MAX];
    int count;
    stop = FIT_E_CANCELED;
    if (!search_set(s, options, niche, &count))
        goto out;
    if (sample.count) {
        count = count < FULL ? count : FULL;
        for (int i = 0; i < count; i++)
            if (!polish(set, space, LAST_STEPS, control, &niche[i]))
                goto out;
        qsort(niche, (size_t)count, sizeof *niche, by_optimum);
    }
    if (options->trace)
        options->trace(options->trace_ctx, GENERATIONS + 1, niche[0].q / set->ff,
                       niche[0].q / set->ff);
    *ret_optimum = niche[0];
    stop = 0;
out:
    set_free(&sample);
    free(s);
    return stop;
}
