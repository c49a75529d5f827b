// SPDX-License-Identifier: MIT
// The operating system as the program under test sees it, in virtual time: clocks, sleeping, an
// agenda of what happens when, and a trace of every byte on the wires. tests/dst/libc.c defines
// libc's calls over it, which take precedence in the whole program, libmodbus and SQLite included.
// Only waiting moves time. One thread, one operating system a process.
//
// Three clocks: the world's (CLOCK_BOOTTIME), which never stops; CLOCK_MONOTONIC, which stands
// still while the machine is suspended; UTC, which may be set. The store is another thread in the
// product: while os.storing, time is its own and runs ahead of the world's (os.store_ns), and what
// it answers arrives when it has.
#pragma once
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#define OS_NEVER INT64_MAX
#define OS_MS(ms) ((int64_t)((ms)*1e6))
#define OS_S(s) ((int64_t)((s)*1e9))

enum { OS_AGENDA = 256 };

struct os_entry {
    int64_t t_ns;
    void (*happen)(void *ctx, int arg);
    void *ctx;
    int arg;
};

// Dice: SplitMix64. Each purpose has its own, so that another fault here is not other noise there.
struct dice {
    uint64_t state;
};

struct os {
    bool on;           // off: libc is as it is
    int64_t now_ns;    // of the world
    int64_t asleep_ns; // suspended so far
    int64_t utc_ns;    // UTC at world time 0
    bool storing;      // the store thread's code runs
    int64_t store_ns;  // its time
    uint64_t cuts;     // times it was woken to find nothing (busy waits of SQLite)
    struct os_entry agenda[OS_AGENDA];
    int entries;
    int64_t next_ns;                          // of the agenda
    void (*on_step)(void *ctx, int64_t t_ns); // each time something may have changed
    void *ctx;
    uint64_t hash, traced;
    FILE *trace; // NULL: only the hash
};

extern struct os os;

void os_begin(void (*on_step)(void *ctx, int64_t t_ns), void *ctx);
void os_end(void);

int64_t os_monotonic_ns(void);
int64_t os_utc_ns(void);
// What happens must not wait.
void os_at(int64_t t_ns, void (*happen)(void *ctx, int arg), void *ctx, int arg);
// Moves time until ready says yes (true) or until_ns (false); next_ns (with ready) is when it may.
bool os_wait(int64_t until_ns, bool (*ready)(void *ctx), int64_t (*next_ns)(void *ctx), void *ctx);
void os_sleep(int64_t ns);   // of whichever thread runs
void os_suspend(int64_t ns); // the machine sleeps, the world does not

// Into the hash with the time; a line of the trace when there is one.
void os_trace(const char *who, char way, const void *bytes, unsigned long size);

struct dice dice_of(uint64_t seed, uint64_t purpose);
uint64_t dice_bits(struct dice *d);
unsigned dice_below(struct dice *d, unsigned sides);
double dice_unit(struct dice *d); // in [0, 1)
double dice_between(struct dice *d, double low, double high);
