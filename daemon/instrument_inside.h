// SPDX-License-Identifier: MIT
// What instrument.c (links, waiting, status) and instrument_calls.c (what each device does) share;
// nobody else includes it.
#pragma once
#include "campaign/bench.h"
#include "daemon/instrument.h"
#include "drivers/backoff.h"
#include "drivers/guard_link.h"

struct bus;
struct profile;

// The clock that drivers and waits use: its sleeping renews the laser's lease.
struct breathing {
    struct clk clk;
    struct clk *inner;
    struct instrument *in;
};

struct motor {
    const struct bench_axis *config;
    struct profile *profile; // of its kind of controller; NULL: made from ready objects
    struct axis *axis;
    int bus; // index; -1: made from ready objects
    struct axis_place place;
    int64_t seen_ns;  // when place was read; INT64_MIN: a command was sent since
    double commanded; // last target sent; NAN: none, or stopped since
    bool engaged;
};

struct instrument {
    const struct bench_config *bench;
    struct kinematics kinematics;
    struct breathing breathing;
    void (*watcher)(void *ctx);
    void *watcher_ctx;

    struct part_state part[PART_COUNT];
    struct backoff retry[PART_COUNT];

    struct bus *bus[BENCH_BUSES];
    struct motor motor[INSTRUMENT_AXES];
    struct profile *laser_profile, *detector_profile; // loaded when first needed; NULL before
    struct guard_host host;   // no connect: there is no guard process
    struct guard_link *guard; // NULL: not needed yet
    struct safety *safety;
    const struct cancel *stop; // that the laser obeys; NULL: none
    struct laser_status laser;
    struct detector *detector;
    int range;
    double time_constant_s;
    struct detector_sample sample;
};

// Keeps the part's book: what came of a call to it. Puts its name before the error's text. Returns
// rc.
int instrument_note(struct instrument *in, enum instrument_part part, int rc,
                    struct gon_error *err);
// 0 when the part's object exists, so that it can be asked at all.
int instrument_need(struct instrument *in, enum instrument_part part, struct gon_error *err);
int instrument_write_set_up(struct instrument *in, struct gon_error *err); // of the detector
