// SPDX-License-Identifier: MIT
// The runs: which one is measured, which wait, what became of the others. A core without threads,
// files or devices: it is told what happened and says through its ports what to do next, so that
// tests step it.
//
//   submit -> queued -> open (store) -> start (instrument) -> fits -> close (store)
//   -> done | stopped | failed
//
// One run has the bench at a time; a run is finished when its last fit is stored and its file is
// closed. A stop ends the run that has the bench and puts back those that wait: nothing starts by
// itself after a stop. Thread: main.
#pragma once
#include "daemon/engine.h"

#include <stdbool.h>
#include <stddef.h>

struct queue;

struct run {
    int id;
    char path[512], name[128], sample[128];
    enum run_state state;
    char text[480];      // why it is paused, stopped or failed; "" otherwise
    int sweep, sweeps;   // 0 while preparing
    int done, total;     // points
    // Of the last reading; NAN before there is one.
    double theta_i_deg, theta_r_deg, f_per_sr, u_per_sr;
    unsigned flags;
    double left_s;       // NAN unknown; of one that waits: for all of it
    bool held;           // waits until it is released
    enum safety_light light;
    char asks[160]; // what a person has to do before it goes on; "": nothing
    bool wanted; // the pause is the operator's: nothing is wrong
    int fits_open;       // asked for and not yet stored
    bool fit_failed;     // the last one
    char *fit;           // JSON of the last one stored; NULL: none in this life of the daemon
};

struct queue_ports {
    void *ctx;
    void (*open)(void *ctx, const struct run *run);  // queue_opened answers
    // queue_ended answers; material is given away.
    void (*start)(void *ctx, const struct run *run, void *material);
    void (*fit)(void *ctx, const struct run *run, int sweep, bool last); // queue_fitted answers
    void (*close)(void *ctx, const struct run *run, enum run_state as); // queue_closed answers
    void (*cancel)(void *ctx);   // ask the workers to stop
    void (*rearm)(void *ctx);    // they have all stopped
    void (*changed)(void *ctx, const struct run *run); // its state
    void (*keep)(void *ctx);     // the queue, as queue_entries gives it
};

struct queue *queue_new(const struct queue_ports *ports); // NULL without memory
void queue_free(struct queue *q);

// A run that exists as a file, with its state there. An id that is known is brought up to date,
// unless the run has the bench or waits. NULL without memory.
struct run *queue_know(struct queue *q, const struct run *run);

// Queues a known run. GON_E_INPUT: no such run; GON_E_REFUSED: it is done, is queued or has the
// bench already, or the daemon is ending.
int queue_submit(struct queue *q, int id, struct gon_error *err);
// Whether it would: the same errors.
int queue_may_submit(const struct queue *q, int id, struct gon_error *err);

// --- the order -----------------------------------------------------------------------------------

// What waits, in its order; the run that has the bench, if any, first.
struct queue_entry {
    const struct run *run;
    bool active;
};
size_t queue_entries(const struct queue *q, struct queue_entry *ret_entries, size_t most);
// Of an earlier life, in that order: it waits as what it was, and the queue is held. What is done or
// not known is left out.
void queue_restore(struct queue *q, int id, bool held);

// GON_E_INPUT: that run does not wait in the queue, or no such place. by: "uid 1000", for its text.
int queue_remove(struct queue *q, int id, const char *by, struct gon_error *err);
int queue_move(struct queue *q, int id, int place, struct gon_error *err); // 1: the next one
int queue_hold(struct queue *q, int id, bool held, struct gon_error *err); // id 0: the queue
bool queue_is_held(const struct queue *q);

// Ends the run that has the bench and empties the queue; false when there is nothing to stop.
bool queue_stop(struct queue *q, const char *why);
void queue_end(struct queue *q); // as stop, and nothing can be submitted afterwards

// What happened. Material is what the store read for the engine; NULL: it could not, as err says.
void queue_opened(struct queue *q, int id, void *material, const struct gon_error *err);
void queue_engine_event(struct queue *q, int id, const struct engine_event *event);
void queue_fit_asked(struct queue *q, int id, int sweep, bool last);
// fit NULL: it failed.
void queue_fitted(struct queue *q, int id, const char *fit, const struct gon_error *err);
void queue_ended(struct queue *q, int id, enum run_state state, const struct gon_error *err);
void queue_closed(struct queue *q, int id, const struct gon_error *err); // err NULL: closed well
// Closed well, but points of it are to be measured again: it waits, as the first.
void queue_reopened(struct queue *q, int id);

const struct run *queue_active(const struct queue *q); // has the bench; NULL: none
const struct run *queue_run(const struct queue *q, int id);
// By rising id; NULL beyond the last.
const struct run *queue_at(const struct queue *q, size_t index);
bool queue_idle(const struct queue *q); // no run has the bench
