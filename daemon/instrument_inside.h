// SPDX-License-Identifier: MIT
// What instrument.c (links, waiting, status), instrument_calls.c (what axes, laser and detector
// do), instrument_snapshot.c, instrument_monitor.c and instrument_devices.c share; nobody else
// includes it.
#pragma once
#include "campaign/bench.h"
#include "daemon/instrument.h"
#include "daemon/suspend.h"
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

// A detector of its own.
struct monitor {
    struct profile *profile;
    struct detector *detector;
    int range; // set last; -1: none yet
    double time_constant_s;
};

// A selector or inputs: one of both, NULL before it was opened first.
struct companion {
    const struct bench_device *config; // NULL: the bench has none
    struct profile *profile;
    struct selector *selector;
    struct inputs *inputs;
    int bus;         // index; -1: it has a link of its own
    int position;    // seen last; SELECTOR_ELSEWHERE
    int64_t read_ns; // the last look at inputs, also one that failed; INT64_MIN: never
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
    struct arm arm;
    bool alarmed; // the arm heard of the alarm that stands
    enum safety_light behind; // of the laser whose place another took; SAFETY_LIGHT_OFF: none did
    const struct cancel *stop; // that the laser obeys; NULL: none
    struct laser_status laser;
    struct detector *detector;
    int range;
    double time_constant_s;
    struct detector_sample sample;
    struct monitor monitor;
    struct companion companion[BENCH_DEVICES];
    struct suspend suspend;
    int64_t looked_ns; // at what the suspenders want to see; INT64_MIN: never
    bool steady, sampled_steady; // the light; and a sample was taken since
    double (*free_mb)(void *ctx);
    void *free_mb_ctx;
    bool (*heed)(void *ctx);
    void *heed_ctx;
    int talking; // the part that is being talked to, whose link nobody else may use; PART_COUNT:
                 // none
};

// Keeps the part's book: what came of a call to it. Puts its name before the error's text. Returns
// rc.
int instrument_note(struct instrument *in, enum instrument_part part, int rc,
                    struct gon_error *err);
// What came of identifying whoever answers: whether it is the part that was there before, by its
// serial number; then the part has the identity. GON_E_DEVICE: another one, and the part is refused.
int instrument_recognise(struct part_state *p, int rc, const char *identity, struct gon_error *err);
// 0 when the part's object exists, so that it can be asked at all.
int instrument_need(struct instrument *in, enum instrument_part part, struct gon_error *err);
bool instrument_is_there(const struct instrument *in, enum instrument_part part); // can be asked
int instrument_write_set_up(struct instrument *in, struct gon_error *err);        // of the detector
int instrument_sample_detector(struct instrument *in, struct gon_error *err);     // and no more
int instrument_open_bus(struct instrument *in, int bus, struct gon_error *err);   // or reopens it

// --- instrument_monitor.c ---
int instrument_connect_monitor(struct instrument *in, struct gon_error *err);
int instrument_sample_monitor(struct instrument *in, double *ret_value, struct gon_error *err);
int instrument_clear_monitor(struct instrument *in, struct gon_error *err);
void instrument_show_monitor(const struct instrument *in, struct instrument_snapshot *s);
void instrument_free_monitor(struct instrument *in);

// --- instrument_devices.c ---
void instrument_make_devices(struct instrument *in); // their parts' books, nothing is opened
int instrument_connect_device(struct instrument *in, enum instrument_part part,
                              struct gon_error *err);
void instrument_ask_device(struct instrument *in, enum instrument_part part); // how it is
bool instrument_device_there(const struct instrument *in, enum instrument_part part);
const struct link_stats *instrument_device_stats(const struct instrument *in,
                                                 enum instrument_part part);
void instrument_show_devices(const struct instrument *in, struct instrument_snapshot *s);
void instrument_free_devices(struct instrument *in);
void instrument_refresh_inputs(struct instrument *in); // those that are there

// --- instrument_suspend.c ---
void instrument_show_suspenders(const struct instrument *in, struct instrument_snapshot *s);

// The relays of inputs are kept on, those whose link is not in use.
void instrument_keep_relays(struct instrument *in);
