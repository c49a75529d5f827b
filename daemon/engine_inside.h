// SPDX-License-Identifier: MIT
// What engine.c (the run), engine_pause.c (the safe state and how it is left), engine_suspend.c
// (suspenders and interruptions), engine_reference.c (references after a gap), engine_steps.c (what
// a person does), engine_light.c (the laser's part), engine_elements.c (the elements of
// polarisation), engine_devices.c (shutters, filter wheels and the like) and engine_verify.c
// (whether a reading is one) share; nobody else includes it.
#pragma once
#include "daemon/acquire.h"
#include "daemon/engine.h"
#include "daemon/instrument.h"

struct plan_point;
struct travel_pose;

enum {
    ENGINE_AGAIN = 1,                 // not done, but nothing is wrong
    ENGINE_REFERENCES = 1 + POL_COUNT // dark, and the beam in each state of the light
};

struct engine {
    const struct engine_ports *ports;
    struct instrument *in;
    const struct campaign_config *config;
    const struct plan *plan;

    enum run_state state;
    const struct plan_point *point; // in progress; NULL: none
    int done, attempt;
    bool ready;  // connected, homed
    bool lit;    // laser on, warmed up, monitor steady
    bool dark;   // laser off, read back at this campaign's own request; or the shutter closed that
                 // makes the darks
    bool wanted; // the pause is the operator's
    char asks[160];           // of whoever is there; "": nothing
    char station[BENCH_NAME]; // where the bench was made ready for; "": the sample
    int stepped;              // the point before which a sweep's step was done; -1: none
    bool asking;              // somebody asked for a pause, as asked says
    struct engine_asked asked;
    bool heeding;               // waits may be interrupted: a point is in progress
    bool suspended;             // by a suspender, as why says
    struct gon_error interrupt; // why a wait of this point was; code 0: none was
    int tries;   // of a suspender that only light shows, since the last accepted reading
    int returns; // pauses that ended by themselves since the last accepted reading
    int64_t light_ns, source_ns, laser_look_ns; // light_ns: also of arrivals
    struct acquire acquire;
    int devices_sweep;            // in which all selectors were read back; -1: none
    unsigned sought;              // selectors that were set again at this point, a bit each
    enum instrument_part strayed; // found elsewhere after the last reading; PART_COUNT: none

    double omega_sr, monitor_dark_v, monitor_lit_v;
    struct engine_opening opening;   // the newest
    bool gap;                        // the light was off since: they have to be measured again
    bool referring;                  // which is being done
    unsigned fresh;                  // opening points measured since, a bit each
    int64_t gap_utc_ms;              // of the last reading before
    double gap_s;                    // how long it was
    struct engine_opening before;    // the gap
    int attempts[ENGINE_REFERENCES]; // of the opening points
    int64_t last_utc_ms;             // of the newest reading
    int64_t pace_ns; // when the sample's first point since the preparation was done; 0: none yet
    int pace_done;   // points done then
    struct gon_error why; // of the last failure
};

// Functions return 0, or a gon_code with its text in e->why.

// --- engine.c ---
// An event row, and the same for whoever watches.
void engine_say(struct engine *e, enum engine_event_kind kind, const char *level, const char *fmt,
                ...) __attribute__((format(printf, 4, 5)));
// A state, for the file and for whoever watches; again the same without a text is no news.
void engine_enter(struct engine *e, enum run_state state, const char *text);

int engine_do_point(struct engine *e); // or ENGINE_AGAIN

// --- engine_reference.c ---
bool engine_has_beam(const struct engine *e);
void engine_count_attempts(struct engine *e); // of the opening points, at the beginning
void engine_keep_attempt(struct engine *e);   // of the point that is done
void engine_begin_gap(struct engine *e);      // the light goes off, or nobody knows
void engine_freshen(struct engine *e);        // there is a good reading of the point
// The opening references again, where there was a gap and the sample is next; not those that were
// measured since.
int engine_refer(struct engine *e);

// --- engine_steps.c ---
// What a person has to do before this point, one after the other. ENGINE_AGAIN: there was a pause.
int engine_operator_steps(struct engine *e);

// --- engine_pause.c ---
int engine_canceled(struct engine *e);                 // GON_E_CANCELED
int engine_nap(struct engine *e, int64_t ns);          // GON_E_CANCELED
const char *engine_light_text(const struct engine *e); // what may be said of the laser
void engine_make_safe(struct engine *e);               // emission off, axes stopped
// RUN_PAUSED; where the laser is not known to be off the text begins with that.
void engine_enter_pause(struct engine *e, const char *text);
// Safe, then what is to be done depends on what happened (e->why). 0: go on; GON_E_CANCELED.
int engine_pause_run(struct engine *e);
bool engine_pause_asked(struct engine *e);    // true once
int engine_operator_paused(struct engine *e); // GON_E_REFUSED with its text
int engine_wait_for_operator(struct engine *e);
int engine_take_over(struct engine *e); // of a pause that would end by itself: the operator's now

// --- engine_suspend.c ---
int engine_suspended(struct engine *e); // looks; GON_E_REFUSED: one keeps the run
bool engine_heed(void *ctx);            // for instrument_heed; ctx: the engine
// What a point ended with: where that was an interruption, why; else rc.
int engine_interrupted(struct engine *e, int rc);
int engine_sit_out(struct engine *e); // a suspender's pause. 0: go on; GON_E_CANCELED

// --- engine_elements.c ---
// To the point's states; what stands there already is only looked at, now and then.
int engine_turn_elements(struct engine *e);

// --- engine_devices.c ---
// Selectors to where the point has them; all are read back once in each sweep.
int engine_place_devices(struct engine *e);
// Whether the point's station has any of them elsewhere than usual.
bool engine_station_places(const struct engine *e);
// Whether all answer, while the laser warms up; where they stand is seen to before the sweep.
int engine_look_at_devices(struct engine *e);
// All read back after a reading: with one elsewhere the reading does not count. Then, once it is
// stored, that one is set again, the first time at a point.
int engine_confirm_devices(struct engine *e, struct acquire_reading *r);
int engine_seek_device(struct engine *e);
// The shutter that makes the darks, if there is one: closed, and no light behind it.
bool engine_shutter_darkens(const struct engine *e);
int engine_shut(struct engine *e);

// --- engine_verify.c ---
// At the end of a reading: the axes stand where they stood, and a dark was dark. Otherwise the
// reading is flagged, not accepted, and this is the error of the run.
int engine_verify(struct engine *e, const struct travel_pose *at, struct acquire_reading *r);

// --- engine_light.c ---
// Darks without light, everything else with it, warmed up and steady.
int engine_light_for(struct engine *e);
// The guard did not switch the laser off by itself, and is there.
int engine_heed_guard(struct engine *e);
// The laser was on and should be: one short question, and only when it is due; or all there is to
// know.
int engine_watch_laser(struct engine *e);
int engine_check_laser(struct engine *e);
