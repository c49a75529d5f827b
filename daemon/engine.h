// SPDX-License-Identifier: MIT
// The campaign as straight-line code: opens nothing, owns nothing but its own progress. It runs on
// the instrument thread, or on a test's only thread in virtual time: time, storage, publishing and
// fitting come through engine_ports, the bench through struct instrument.
//
//   dark (laser off) -> laser on, warm-up -> beam -> sweeps (a fit is asked for after each) -> beam
//   -> laser off -> dark -> last fit
//
// The elements of polarisation stand at a point's states before the directions' axes move; the
// light may stay on.
//
// The laser is on from warm-up to the last beam reading and off on every way out. A device that is
// gone or does not answer pauses the run in a safe state (emission off where the laser can be
// reached, axes stopped) and it goes on by itself once the device is back and identified, from the
// point in progress; an interlock, a device's fault or a refused command pauses until somebody
// resumes. So does a suspender of the bench (daemon/suspend.h), also in the middle of a point: that
// attempt is given up, and nothing of it is stored. After a pause and when a campaign goes on, the
// opening references are measured again before the next point on the sample (campaign/reduce.h),
// unless they were since. Each reading is acknowledged by the store before the next point begins.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"
#include "campaign/polarisation.h"
#include "daemon/safety.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct campaign_config;
struct instrument;
struct plan;
struct store_reading;

enum run_state {
    RUN_QUEUED,
    RUN_PREPARING, // identify, home, dark, warm-up, beam
    RUN_RUNNING,
    RUN_PAUSED,
    RUN_STOPPING,
    RUN_STOPPED, // by somebody, or by the daemon's end; can be resumed
    RUN_DONE,
    RUN_FAILED
};

const char *run_state_name(enum run_state s); // "queued", "preparing", ...

// What happened, for whoever watches. Text is borrowed for the call.
enum engine_event_kind { ENGINE_STATE, ENGINE_READING, ENGINE_SWEEP, ENGINE_LOG };

struct engine_event {
    enum engine_event_kind kind;
    enum run_state state;
    int sweep, sweeps; // 1..sweeps; 0 while preparing
    int point, points; // within the whole plan: done and all
    double theta_i_deg;
    double theta_r_deg;
    double f_per_sr; // provisional value of this reading (opening beam and dark); NAN before there
                     // is one
    double u_per_sr; // type A
    unsigned flags;  // of the stored reading
    double left_s;   // estimate; NAN unknown
    enum safety_light light;
    char asks[160];   // what a person has to do before it goes on; "": nothing
    bool wanted;      // ENGINE_STATE, RUN_PAUSED: by the operator; nothing is wrong
    const char *text; // ENGINE_LOG and pauses: one sentence that names the device
};

// The newest opening reference readings, for provisional f_r after a resume, the beam's by the
// light's state; NAN: not measured yet.
struct engine_opening {
    int64_t last_utc_ms; // of the newest reading of all
    double dark_signal_v, dark_monitor_v;
    double beam_signal_v[POL_COUNT], beam_monitor_v[POL_COUNT];
};

// A pause as somebody asked for it.
struct engine_asked {
    bool now;     // the point in progress is given up; otherwise between two points
    char by[300]; // " anna (uid 1000): lunch"; "": nobody knows
};

// While a port waits it calls instrument_breathe at least every 100 ms: the laser's lease.
struct engine_ports {
    void *ctx;
    struct clk *clk;
    const struct cancel *cancel;          // stop: laser off, axes stopped, RUN_STOPPED
    const struct engine_opening *opening; // NULL: a new campaign
    // Returns once the row is committed: 0, or GON_E_STORE (also when there was no acknowledgement
    // for 10 s), GON_E_CANCELED. After GON_E_STORE emission goes off and the same row is offered
    // again until it is accepted, so that a row which did arrive must be accepted again when it is
    // the same.
    int (*store_reading)(void *ctx, const struct store_reading *reading, struct gon_error *err);
    int (*store_event)(void *ctx, const char *level, const char *source, const char *text,
                       struct gon_error *err);
    void (*publish)(void *ctx, const struct engine_event *event);
    void (*request_fit)(void *ctx, int sweep, bool last); // does not wait
    bool (*take_resume)(void *ctx); // true once after an operator's "resume"; asked while paused
    // True once after an operator's "pause"; asked all the time. NULL: nobody pauses.
    bool (*take_pause)(void *ctx, struct engine_asked *ret_asked);
    // True once after an operator's step was acknowledged, asked while one is waited for; ret_by as
    // struct engine_asked's. NULL: nobody does.
    bool (*take_ack)(void *ctx, char *ret_by, size_t size);
};

// Runs the plan from its first point without an accepted reading (the plan carries what is done).
// Returns the state it ended in: RUN_DONE, RUN_STOPPED or RUN_FAILED; err says why it failed.
enum run_state engine_run(const struct engine_ports *ports, struct instrument *instrument,
                          const struct campaign_config *config, const struct plan *plan,
                          struct gon_error *err);
