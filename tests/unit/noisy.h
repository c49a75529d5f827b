// SPDX-License-Identifier: MIT
// A bad cable between a driver and a simulated port: answers get lost, late, doubled, cut, split,
// wrapped in garbage or changed, at random and repeatably. Replies of one frame stay whole in the
// port behind it. No answer overtakes an earlier one: a double that comes late holds up the line.
#pragma once
#include "sim/port.h"

#include <string.h>

enum noisy_fault {
    NOISY_LOST,
    NOISY_LATE,
    NOISY_DOUBLED,
    NOISY_CUT,
    NOISY_SPLIT,
    NOISY_BEFORE,
    NOISY_AFTER,
    NOISY_CHANGED,
    NOISY_FAULTS,
    // only where they are asked for (all)
    NOISY_MERGED = NOISY_FAULTS, // behind the last answer once more, in one frame
    NOISY_HEADLESS,              // begins too late
    NOISY_ALL
};

struct noisy {
    struct port port; // first
    struct port *inner;
    uint64_t dice;
    unsigned one_in;                           // answers per fault; 0: none
    bool all;                                  // also the kinds from NOISY_FAULTS on
    unsigned only;                             // bits of noisy_fault; 0: all kinds
    const char *garbage_lacks, *changed_lacks; // bytes that never come of it; NULL: none
    int64_t late_most_ns;                      // of a late answer, from when it was due
    int64_t double_most_ns;
    int64_t soon_ns; // half of the delays are at most this; 0: only chance makes them short
    uint64_t faults;
    int lose_nth;                  // this answer from now gets lost; 0: none
    uint8_t last[PORT_REPLY_MOST]; // answer
    size_t last_size;
};

static inline unsigned noisy_roll(struct noisy *n, unsigned sides)
{
    n->dice ^= n->dice << 13;
    n->dice ^= n->dice >> 7;
    n->dice ^= n->dice << 17;
    return (unsigned)(n->dice >> 33) % sides;
}

static inline bool noisy_lacks(const char *lacks, uint8_t byte)
{
    return !lacks || !byte || !strchr(lacks, byte);
}

static inline void noisy_garbage(struct noisy *n, int64_t due_ns)
{
    uint8_t bytes[7];
    size_t size = 1 + noisy_roll(n, sizeof bytes);
    for (size_t i = 0; i < size; i++)
        do
            bytes[i] = (uint8_t)noisy_roll(n, 256);
        while (!noisy_lacks(n->garbage_lacks, bytes[i]));
    port_send(&n->port, bytes, size, due_ns);
}

static inline void noisy_change(struct noisy *n, uint8_t *byte)
{
    const uint8_t was = *byte;
    do
        *byte = was ^ (uint8_t)(1 + noisy_roll(n, 255));
    while (!noisy_lacks(n->changed_lacks, *byte));
}

static inline void noisy_merge(struct noisy *n, const uint8_t *bytes, size_t size, int64_t due_ns)
{
    uint8_t both[PORT_REPLY_MOST];
    const size_t room = sizeof both - size, before = n->last_size < room ? n->last_size : room;
    memcpy(both, n->last, before);
    memcpy(both + before, bytes, size);
    port_send(&n->port, both, before + size, due_ns);
}

static inline int64_t noisy_delay(struct noisy *n, int64_t most_ns)
{
    if (n->soon_ns > 0 && noisy_roll(n, 2) == 0)
        most_ns = n->soon_ns;
    return (int64_t)((double)noisy_roll(n, 1000000) * 1e-6 * (double)most_ns);
}

static inline void noisy_strike(struct noisy *n, unsigned fault, uint8_t *bytes, size_t size,
                                int64_t due_ns)
{
    size_t at;
    switch (fault) {
    case NOISY_LOST: return;
    case NOISY_LATE: due_ns += noisy_delay(n, n->late_most_ns); break;
    case NOISY_DOUBLED:
        port_send(&n->port, bytes, size, due_ns);
        due_ns += noisy_delay(n, n->double_most_ns);
        break;
    case NOISY_CUT: size = noisy_roll(n, (unsigned)size); break;
    case NOISY_SPLIT:
        for (size_t i = 0; i + 1 < size; i++)
            port_send(&n->port, bytes + i, 1, due_ns + (int64_t)i * 500000);
        bytes += size - 1;
        due_ns += (int64_t)size * 500000;
        size = 1;
        break;
    case NOISY_BEFORE: noisy_garbage(n, due_ns); break;
    case NOISY_AFTER:
        port_send(&n->port, bytes, size, due_ns);
        noisy_garbage(n, due_ns);
        return;
    case NOISY_CHANGED: noisy_change(n, &bytes[noisy_roll(n, (unsigned)size)]); break;
    case NOISY_MERGED: noisy_merge(n, bytes, size, due_ns); return;
    case NOISY_HEADLESS:
        at = noisy_roll(n, (unsigned)size);
        bytes += at;
        size -= at;
        break;
    default: break;
    }
    if (size > 0)
        port_send(&n->port, bytes, size, due_ns);
}

static inline void noisy_pass(struct noisy *n, uint8_t *bytes, size_t size, int64_t due_ns)
{
    uint8_t kept[PORT_REPLY_MOST];
    memcpy(kept, bytes, size);
    unsigned fault = NOISY_ALL;
    if (n->one_in && noisy_roll(n, n->one_in) == 0)
        fault = noisy_roll(n, n->all ? NOISY_ALL : NOISY_FAULTS);
    if (n->only && !(n->only >> fault & 1))
        fault = NOISY_ALL;
    if (n->lose_nth > 0 && --n->lose_nth == 0)
        return;
    n->faults += fault < NOISY_ALL;
    noisy_strike(n, fault, bytes, size, due_ns);
    memcpy(n->last, kept, size);
    n->last_size = size;
}

static inline void noisy_feed(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    struct noisy *n = (struct noisy *)p;
    uint8_t reply[PORT_REPLY_MOST];
    int64_t due_ns = t_ns;
    port_feed(n->inner, bytes, size, t_ns);
    for (size_t got; port_next_ns(n->inner) < PORT_NEVER && n->inner->count > 0 &&
                     (got = port_take(n->inner, port_next_ns(n->inner), reply, &due_ns)) > 0;)
        noisy_pass(n, reply, got, due_ns > t_ns ? due_ns : t_ns);
}

static inline void noisy_tick(struct port *p, int64_t t_ns)
{
    (void)p;
    (void)t_ns;
}

static inline void noisy_hangup(struct port *p)
{
    port_hangup(((struct noisy *)p)->inner);
}

static inline void noisy_init(struct noisy *n, struct port *inner, uint64_t seed, unsigned one_in)
{
    static const struct port_ops ops = {noisy_feed, noisy_tick, noisy_hangup};
    memset(n, 0, sizeof *n);
    port_init(&n->port, &ops);
    n->inner = inner;
    n->dice = seed;
    n->one_in = one_in;
}
