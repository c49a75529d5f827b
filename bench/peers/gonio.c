// SPDX-License-Identifier: MIT
// gonio's own search, with everything that fit_run does before it.
#include "bench/peers/method.h"

#include "fit/memetic.h"

static void note(void *ctx, int generation, double best_delta, double mean_delta)
{
    (void)generation;
    (void)mean_delta;
    attempt_found(ctx, best_delta);
}

void peer_gonio(struct attempt *a, const struct setting *s, uint64_t seed)
{
    (void)s;
    struct fit_options o = a->task->options;
    struct fit_set set;
    struct fit_optimum best;
    o.seed = seed;
    o.trace = note;
    o.trace_ctx = a;
    if (set_compile(&a->task->data, &o, &a->control, &set))
        return;
    if (memetic_search(&set, &a->task->space, &o, &a->control, &best) == 0)
        attempt_found(a, best.q / set.ff);
    a->values += lrint(a->control.points / (double)set.padded);
    set_free(&set);
}
