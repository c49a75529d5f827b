// SPDX-License-Identifier: MIT
#include "drivers/blocks.h"

#include "drivers/registers.h"

#include <assert.h>
#include <stddef.h>
#include <stdlib.h>

// A run of one table's registers, end not included.
struct run {
    int table, begin, end;
    int first; // place in the asks
    bool alone;
};

static struct run run_of(const struct profile *p, int value, int first)
{
    const struct profile_value *v = &p->values[value];
    int address = 0;
    const int rc = registers_address(p, v, &address, NULL);
    return (struct run){v->table, address, rc < 0 ? address : address + registers_count(v), first,
                        v->alone};
}

// What tells answers of one function apart: registers, or the bytes that bits fill.
static int length_of(const struct run *r)
{
    const int count = r->end - r->begin;
    return r->table == PROFILE_COIL || r->table == PROFILE_DISCRETE ? (count + 7) / 8 : count;
}

static bool are_alike(const struct run *a, const struct run *b)
{
    return a->table == b->table && length_of(a) == length_of(b);
}

// --- merging -------------------------------------------------------------------------------------

static bool may_be_read(const struct profile *p, const struct run *r)
{
    for (int i = 0; i < p->values_count; i++) {
        const struct profile_value *v = &p->values[i];
        const struct run other = run_of(p, i, 0);
        if ((v->alone || v->access == PROFILE_WRITE) && other.table == r->table &&
            other.begin < r->end && other.end > r->begin)
            return false;
    }
    return true;
}

static struct run joined(const struct run *a, const struct run *b)
{
    return (struct run){a->table, a->begin < b->begin ? a->begin : b->begin,
                        a->end > b->end ? a->end : b->end,
                        a->first < b->first ? a->first : b->first, false};
}

static bool may_join(const struct profile *p, const struct run *a, const struct run *b)
{
    const struct run all = joined(a, b);
    const int gap = a->begin < b->begin ? b->begin - a->end : a->begin - b->end;
    return a->table == b->table && !a->alone && !b->alone && gap <= p->registers.gap_most &&
           all.end - all.begin <= p->registers.block_most && may_be_read(p, &all);
}

static int compare_places(const void *a, const void *b)
{
    const struct run *x = a, *y = b;
    if (x->table != y->table)
        return x->table - y->table;
    return x->begin != y->begin ? x->begin - y->begin : x->first - y->first;
}

static int compare_order(const void *a, const void *b)
{
    return ((const struct run *)a)->first - ((const struct run *)b)->first;
}

static int merge(const struct profile *p, struct run *run, int count)
{
    int n = 0;
    qsort(run, (size_t)count, sizeof *run, compare_places);
    for (int i = 1; i < count; i++)
        if (may_join(p, &run[n], &run[i]))
            run[n] = joined(&run[n], &run[i]);
        else
            run[++n] = run[i];
    n += count > 0;
    qsort(run, (size_t)n, sizeof *run, compare_order);
    return n;
}

// --- lengths -------------------------------------------------------------------------------------

static bool is_unlike_all(const struct run *run, int count, int which, const struct run *candidate)
{
    for (int i = 0; i < count; i++)
        if (i != which && are_alike(&run[i], candidate))
            return false;
    return true;
}

// Takes in the nearest readable neighbour that makes its length a new one.
static void lengthen(const struct profile *p, struct run *run, int count, int which)
{
    struct run best = run[which];
    for (int i = 0; i < p->values_count && !run[which].alone; i++) {
        const struct run other = run_of(p, i, run[which].first);
        if (p->values[i].access == PROFILE_WRITE || !may_join(p, &run[which], &other))
            continue;
        const struct run longer = joined(&run[which], &other);
        const bool shorter = best.end - best.begin == run[which].end - run[which].begin ||
                             longer.end - longer.begin < best.end - best.begin;
        if (shorter && is_unlike_all(run, count, which, &longer))
            best = longer;
    }
    run[which] = best;
}

static void make_lengths_differ(const struct profile *p, struct run *run, int count)
{
    for (int i = 1; i < count; i++)
        for (int j = 0; j < i; j++) {
            if (are_alike(&run[i], &run[j]))
                lengthen(p, run, count, i);
            if (are_alike(&run[i], &run[j]))
                lengthen(p, run, count, j);
        }
}

static int find_alike(const struct run *run, int count)
{
    for (int i = 0; i < count && count > 1; i++)
        if (are_alike(&run[i], &run[(i + 1) % count]))
            return i;
    return -1;
}

static int count_alike(const struct run *run, int count, const struct run *r)
{
    int n = 0;
    for (int i = 0; i < count; i++)
        n += are_alike(&run[i], r);
    return n;
}

// The kind of which most are left goes first, never twice running: that succeeds where anything
// does. Between equals the kind of the very first goes, so that it is not left for the end.
static void rearrange(struct run *run, int count)
{
    for (int done = 0; done < count; done++) {
        int best = -1, most = 0;
        for (int i = done; i < count; i++) {
            if (done > 0 && are_alike(&run[i], &run[done - 1]))
                continue;
            const int left = 2 * count_alike(run + done, count - done, &run[i]) +
                             (done > 0 && are_alike(&run[i], &run[0]));
            if (left > most) {
                most = left;
                best = i;
            }
        }
        if (best < 0)
            return;
        const struct run next = run[best];
        for (int i = best; i > done; i--)
            run[i] = run[i - 1];
        run[done] = next;
    }
}

// --- the plan ------------------------------------------------------------------------------------

static int find_readable(const struct profile *p, const char *name, int *ret_value,
                         struct gon_error *err)
{
    int address;
    const int value = profile_value(p, name);
    if (value < 0)
        return gon_fail(err, GON_E_INPUT, "there is no value \"%s\"", name);
    if (p->values[value].access == PROFILE_WRITE)
        return gon_fail(err, GON_E_INPUT, "%s: can be written, not read", name);
    *ret_value = value;
    return registers_address(p, &p->values[value], &address, err);
}

static void locate(const struct profile *p, const struct run *run, struct block_plan *plan, int ask)
{
    const struct run own = run_of(p, plan->ask[ask].value, ask);
    for (int i = 0; i < plan->count; i++) {
        const bool covers =
            run[i].table == own.table && run[i].begin <= own.begin && run[i].end >= own.end;
        const bool fits = covers && run[i].alone == own.alone &&
                          (!own.alone || run[i].end - run[i].begin == own.end - own.begin);
        if (!fits)
            continue;
        plan->ask[ask].block = i;
        plan->ask[ask].at = own.begin - run[i].begin;
        return;
    }
    assert(!"each value lies in a block");
}

int blocks_plan(const struct profile *p, const struct profile_asks *asks,
                struct block_plan *ret_plan, struct gon_error *err)
{
    struct block_plan plan = {.asks = asks->count};
    struct run run[PROFILE_ASKS];
    assert(asks->count <= PROFILE_ASKS);
    for (int i = 0; i < asks->count; i++) {
        int rc = find_readable(p, asks->name[i], &plan.ask[i].value, err);
        if (rc < 0)
            return rc;
        run[i] = run_of(p, plan.ask[i].value, i);
    }
    plan.count = merge(p, run, asks->count);
    make_lengths_differ(p, run, plan.count);
    if (find_alike(run, plan.count) >= 0)
        rearrange(run, plan.count);
    plan.alike = find_alike(run, plan.count);
    for (int i = 0; i < plan.count; i++)
        plan.block[i] =
            (struct block){run[i].table, run[i].begin, run[i].end - run[i].begin, run[i].first};
    for (int i = 0; i < plan.asks; i++)
        locate(p, run, &plan, i);
    *ret_plan = plan;
    return 0;
}

// --- for people ----------------------------------------------------------------------------------

static const struct {
    const char *name;
    size_t offset;
} lists[] = {
    {"identify.asks", offsetof(struct profile, identify.asks)},
    {"laser.status", offsetof(struct profile, laser.status)},
    {"laser.once", offsetof(struct profile, laser.once)},
    {"laser.light", offsetof(struct profile, laser.light)},
    {"laser.before_on", offsetof(struct profile, laser.before_on)},
    {"laser.after_refusal", offsetof(struct profile, laser.after_refusal)},
    {"laser.off_asks", offsetof(struct profile, laser.off_asks)},
    {"detector.read_range", offsetof(struct profile, detector.read_range)},
    {"detector.sample", offsetof(struct profile, detector.sample)},
    {"detector.sample_monitor", offsetof(struct profile, detector.sample_monitor)},
    {"detector.clear", offsetof(struct profile, detector.clear)},
    {"detector.condition", offsetof(struct profile, detector.condition)},
    {"axis.status", offsetof(struct profile, axis.status)},
    {"selector.status", offsetof(struct profile, selector.status)},
    {"inputs.status", offsetof(struct profile, inputs.status)},
};

static void print_block(const struct profile *p, const struct block_plan *plan, int which,
                        const char *name, FILE *out)
{
    static const int function[] = {3, 4, 1, 2};
    static const char *const what[] = {"register", "input register", "coil", "discrete input"};
    const struct block *b = &plan->block[which];
    const char *before = ": ";
    fprintf(out, "%s: function %d, %04Xh, %d %s%s", name, function[b->table], (unsigned)b->address,
            b->count, what[b->table], b->count == 1 ? "" : "s");
    for (int i = 0; i < plan->asks; i++)
        if (plan->ask[i].block == which) {
            fprintf(out, "%s%s", before, p->values[plan->ask[i].value].name);
            before = ", ";
        }
    fputc('\n', out);
}

static bool answers_fit(const struct block *a, const struct block *b)
{
    const struct run first = {a->table, a->address, a->address + a->count, 0, false};
    const struct run second = {b->table, b->address, b->address + b->count, 0, false};
    return are_alike(&first, &second) && a->address != b->address;
}

static int print_alike(const struct block *a, const struct block *b, const char *name, FILE *out)
{
    fprintf(out,
            "%s: the requests for %04Xh and %04Xh have answers of the same length: a late one can "
            "be taken for the other; declare a readable value beside one of them\n",
            name, (unsigned)a->address, (unsigned)b->address);
    return 1;
}

// before: the last request of the list before this one, of which count is 0 when there is none.
static int print_plan(const struct profile *p, const struct profile_asks *asks, const char *name,
                      struct block *before, FILE *out)
{
    struct block_plan plan;
    struct gon_error err;
    int wrong = 0;
    if (blocks_plan(p, asks, &plan, &err) < 0) {
        fprintf(out, "%s: %s\n", name, err.text);
        return 1;
    }
    for (int i = 0; i < plan.count; i++)
        print_block(p, &plan, i, name, out);
    if (plan.alike >= 0)
        wrong += print_alike(&plan.block[plan.alike], &plan.block[(plan.alike + 1) % plan.count],
                             name, out);
    if (before->count > 0 && answers_fit(before, &plan.block[0]))
        wrong += print_alike(before, &plan.block[0], name, out);
    *before = plan.block[plan.count - 1];
    return wrong;
}

int blocks_print(const struct profile *p, FILE *out)
{
    struct block before = {.count = 0};
    int wrong = 0;
    for (size_t i = 0; i < sizeof lists / sizeof lists[0]; i++) {
        const struct profile_asks *asks =
            (const struct profile_asks *)((const char *)p + lists[i].offset);
        if (asks->count > 0)
            wrong += print_plan(p, asks, lists[i].name, &before, out);
    }
    return wrong;
}
