// SPDX-License-Identifier: MIT
// The middle of the daemon: on the main thread it passes messages between the queue, the workers
// and HTTP. It touches no device and no file itself.
#pragma once
#include "base/err.h"
#include "daemon/arming.h"
#include "daemon/control.h"
#include "daemon/events.h"
#include "daemon/http.h"
#include "daemon/instrument.h"
#include "daemon/queue.h"

#include <stdbool.h>
#include <stdint.h>

struct bench_config;
struct guard_host;
struct hub;
struct log;
struct store_profile;
struct loop;

struct hub_options {
    const struct bench_config *bench; // borrowed for the hub's life
    const struct guard_host *guard; // borrowed: the process that holds the laser's port
    const char *bench_text; // as read, for the campaign files
    const struct store_profile *profiles; // likewise, borrowed
    int profiles_count;
    const char *directory;               // of the campaign files
    bool simulator;
    long seed;
    struct log *log;
    // Once, when the bench was looked at.
    void (*ready)(void *ctx, const struct instrument_snapshot *s);
    // Each time it was looked at, about twice a second.
    void (*looked)(void *ctx, const struct instrument_snapshot *s);
    // The workers are idle; err: why it could not go on.
    void (*ended)(void *ctx, const struct gon_error *err);
    void *ctx;
};

int hub_new(struct loop *loop, int listen_fd, const struct hub_options *options,
            struct hub **ret_hub, struct gon_error *err);
void hub_end(struct hub *h);  // laser off, axes stopped, everything committed; then ended is called
// Joins the workers; NULL is fine. True when the laser was not read back off: it may be on.
bool hub_free(struct hub *h);

// For api.c: what a request asks for. A ticket is answered later through HTTP.
struct hub_status {
    const char *directory, *last_error;
    bool simulator;
    long seed;
    double uptime_s;
    uint64_t event_id;
    uint64_t readings;                          // stored in this life of the daemon
    const struct instrument_snapshot *snapshot; // NULL: none yet
    double snapshot_age_s;
};
void hub_status(const struct hub *h, struct hub_status *ret_status);
const struct queue *hub_queue(const struct hub *h);
// by: whose command; in that name the laser is armed, where the bench has it so.
void hub_create(struct hub *h, const char *config, const char *name, const char *by,
                uint64_t ticket);
// 1: the run was paused and goes on. 0: its file is looked at, known to the queue or not, and the
// ticket is answered when it is queued or why it cannot be. GON_E_REFUSED: as queue_submit.
int hub_submit(struct hub *h, int run, const char *by, uint64_t ticket, struct gon_error *err);
void hub_submit_path(struct hub *h, const char *path, const char *by, uint64_t ticket);
void hub_find(struct hub *h, int run, uint64_t ticket); // one that the queue does not know
// What becomes of readings of a run; takes the decision. The ticket is answered when it is written,
// and the run queued when a sweep is to be measured again.
struct decision;
void hub_decide(struct hub *h, int run, struct decision *decision, const char *by,
                uint64_t ticket);
// Stops in any case; false: 32 tickets wait for the end of a stop already, and this one will not be
// answered.
bool hub_stop(struct hub *h, const char *why, uint64_t ticket);
// The run that has the bench: its id. by and now: as struct engine_asked.
int hub_pause(struct hub *h, const char *by, bool now, struct gon_error *err);
// A person's step is done; the run that waited for it. said: as by of a pause.
int hub_ack(struct hub *h, const char *said, const char *by, struct gon_error *err);
// The paused run, or when none has the bench a held queue: the id of the run that goes on.
int hub_resume(struct hub *h, const char *by, struct gon_error *err);

// As arming.h. A change's ticket is answered with view_laser.
struct arming *hub_arming(struct hub *h);

// As control.h; the time is now.
const struct control *hub_control(const struct hub *h);
int hub_control_take(struct hub *h, const char *name, const char *reason, const char *from,
                     struct gon_error *err);
int hub_control_release(struct hub *h, const char *name, struct gon_error *err);

// The queue's order; as queue.h. by: who asks.
int hub_queue_remove(struct hub *h, int run, const char *by, struct gon_error *err);
int hub_queue_move(struct hub *h, int run, int place, struct gon_error *err);
int hub_queue_hold(struct hub *h, int run, bool held, const char *by, struct gon_error *err);

uint64_t hub_event_id(const struct hub *h); // of the newest event
// A run with the id of the event after which all of it can be followed, as JSON text.
// Answers once what the queue is now is on the disk; body is taken over.
void hub_answer_kept(struct hub *h, uint64_t ticket, int status, char *body);
char *hub_submitted(const struct hub *h, int run, uint64_t event_id);
