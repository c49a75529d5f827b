// SPDX-License-Identifier: MIT
#include "fit/passes.h"

#include "fit/pool.h"

struct pass {
    const struct fit_set *set;
    const double *x;
    kernel_sums *sums;
    size_t length;
    struct kernel_gram part[KERNEL_PARTS];
};

static size_t lesser(size_t a, size_t b)
{
    return a < b ? a : b;
}

// In slices, between which the part may be canceled: one, below two million readings.
static bool sum_part(void *ctx, int index, struct fit_control *control)
{
    struct pass *p = ctx;
    size_t at = (size_t)index * p->length, rows = p->set->distinct.padded;
    size_t end = at + lesser(p->length, rows - at);
    struct kernel_gram sum = {.m = {{0}}}, slice = {.m = {{0}}};
    for (bool first = true; at < end; first = false) {
        size_t to = at + lesser(CONTROL_SLICE, end - at);
        if (control_spend(control, to - at))
            return false;
        p->sums(p->set, p->x, at, to, first ? &sum : &slice);
        if (!first)
            kernel_add(&sum, &slice);
        at = to;
    }
    p->part[index] = sum;
    return true;
}

static bool run(struct pass *p, struct fit_control *control, struct kernel_gram *ret_gram)
{
    p->length = kernel_part(p->set);
    int count = (int)((p->set->distinct.padded + p->length - 1) / p->length);
    if (!pool_run(control, count, sum_part, p))
        return false;
    for (int i = 1; i < count; i++)
        kernel_add(&p->part[0], &p->part[i]);
    *ret_gram = p->part[0];
    return true;
}

bool passes_moments(const struct fit_set *set, const double x[FIT_PARAMS],
                    struct fit_control *control, struct kernel_gram *ret_gram)
{
    struct pass p; // its parts are written before they are read
    p.set = set;
    p.x = x;
    p.sums = kernel_moments_of;
    return run(&p, control, ret_gram);
}

bool passes_gram(const struct fit_set *set, const double x[FIT_PARAMS],
                 struct fit_control *control, struct kernel_gram *ret_gram)
{
    struct pass p;
    p.set = set;
    p.x = x;
    p.sums = kernel_gram_of;
    return run(&p, control, ret_gram);
}
