// SPDX-License-Identifier: MIT
#include "tests/dst/os.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define BEGIN_NS OS_S(1000)
#define UTC_S 1700000000.0

struct os os;

void os_begin(void (*on_step)(void *ctx, int64_t t_ns), void *ctx)
{
    os = (struct os){.on = true,
                     .now_ns = BEGIN_NS,
                     .utc_ns = OS_S(UTC_S) - BEGIN_NS,
                     .next_ns = OS_NEVER,
                     .on_step = on_step,
                     .ctx = ctx,
                     .hash = 14695981039346656037u};
}

void os_end(void)
{
    os.on = false;
}

static int64_t thread_ns(void)
{
    return os.storing ? os.store_ns : os.now_ns;
}

int64_t os_monotonic_ns(void)
{
    return thread_ns() - os.asleep_ns;
}

int64_t os_utc_ns(void)
{
    return thread_ns() + os.utc_ns;
}

// --- the agenda ----------------------------------------------------------------------------------

static void look_ahead(void)
{
    os.next_ns = OS_NEVER;
    for (int i = 0; i < os.entries; i++)
        if (os.agenda[i].t_ns < os.next_ns)
            os.next_ns = os.agenda[i].t_ns;
}

void os_at(int64_t t_ns, void (*happen)(void *ctx, int arg), void *ctx, int arg)
{
    assert(os.entries < OS_AGENDA);
    os.agenda[os.entries++] = (struct os_entry){t_ns, happen, ctx, arg};
    if (t_ns < os.next_ns)
        os.next_ns = t_ns;
}

// In the order of time, then of entering.
static void happen(void)
{
    while (os.next_ns <= os.now_ns) {
        int first = 0;
        for (int i = 1; i < os.entries; i++)
            if (os.agenda[i].t_ns < os.agenda[first].t_ns)
                first = i;
        const struct os_entry e = os.agenda[first];
        memmove(os.agenda + first, os.agenda + first + 1,
                (size_t)(--os.entries - first) * sizeof e);
        look_ahead();
        e.happen(e.ctx, e.arg);
    }
}

static void step_to(int64_t t_ns)
{
    if (t_ns > os.now_ns)
        os.now_ns = t_ns;
    if (os.on_step)
        os.on_step(os.ctx, os.now_ns);
    happen();
}

bool os_wait(int64_t until_ns, bool (*ready)(void *ctx), int64_t (*next_ns)(void *ctx), void *ctx)
{
    for (;;) {
        if (ready && ready(ctx))
            return true;
        if (os.now_ns >= until_ns)
            return false;
        int64_t t_ns = until_ns < os.next_ns ? until_ns : os.next_ns;
        const int64_t there_ns = next_ns ? next_ns(ctx) : OS_NEVER;
        step_to(there_ns < t_ns ? there_ns : t_ns);
    }
}

void os_sleep(int64_t ns)
{
    if (os.storing) {
        os.store_ns += ns;
        os.cuts++;
        return;
    }
    os_wait(os.now_ns + ns, NULL, NULL, NULL);
}

void os_suspend(int64_t ns)
{
    os.asleep_ns += ns;
    os.now_ns += ns;
}

// --- the trace -----------------------------------------------------------------------------------

static void mix(const void *bytes, unsigned long size) // FNV-1a, 8 bytes a round
{
    const unsigned char *p = bytes;
    for (; size >= 8; p += 8, size -= 8) {
        uint64_t word;
        memcpy(&word, p, 8);
        os.hash = (os.hash ^ word) * 1099511628211u;
        os.hash ^= os.hash >> 29;
    }
    for (; size > 0; p++, size--)
        os.hash = (os.hash ^ *p) * 1099511628211u;
}

void os_trace(const char *who, char way, const void *bytes, unsigned long size)
{
    const unsigned char *p = bytes;
    mix(&os.now_ns, sizeof os.now_ns);
    mix(who, strlen(who));
    mix(&way, 1);
    mix(bytes, size);
    os.traced++;
    if (!os.trace)
        return;
    fprintf(os.trace, "%14.6f %-9s %c ", (double)os.now_ns * 1e-9, who, way);
    for (unsigned long i = 0; i < size; i++)
        fprintf(os.trace, p[i] >= 0x20 && p[i] < 0x7f ? "%c" : "\\%02x", p[i]);
    fputc('\n', os.trace);
}

// --- dice ----------------------------------------------------------------------------------------

static uint64_t stir(uint64_t z)
{
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

struct dice dice_of(uint64_t seed, uint64_t purpose)
{
    return (struct dice){stir(stir(seed + 1) ^ purpose * 0xd1342543de82ef95u)};
}

uint64_t dice_bits(struct dice *d)
{
    return stir(d->state += 0x9e3779b97f4a7c15u);
}

unsigned dice_below(struct dice *d, unsigned sides)
{
    return (unsigned)((dice_bits(d) >> 32) * sides >> 32);
}

double dice_unit(struct dice *d)
{
    return (double)(dice_bits(d) >> 11) * 0x1p-53;
}

double dice_between(struct dice *d, double low, double high)
{
    return low + (high - low) * dice_unit(d);
}
