// SPDX-License-Identifier: MIT
// What hub.c (beginning and end), hub_requests.c (what HTTP asks for), hub_ports.c (what the queue asks
// for), hub_mail.c (what the workers say) and hub_tell.c (what is told to those who watch) share;
// nobody else includes it. Thread: main.
#pragma once
#include "campaign/bench.h"
#include "daemon/hub.h"

#include <jansson.h>

struct note;

enum { MOST_EVENTS = 4096, MOST_EVENT_BYTES = 4 * 1024 * 1024, MOST_STOPS = 32, MOST_KEPT = 1000 };

struct hub {
    struct hub_options options;
    struct loop *loop;
    struct mail *box, *store_box, *run_box, *fit_box; // of each thread
    struct cancel *cancel;
    struct events *events;
    struct http *http;
    struct queue *queue;
    struct control control;
    struct arming arming;
    struct messenger *messenger;          // NULL: nobody is told
    const char *notify[BENCH_NOTIFY + 1]; // its command
    struct storer *storer;
    struct runner *runner;
    struct fitter *fitter;
    struct instrument_snapshot *snapshot; // NULL: none yet
    char last_error[480];
    json_t *put_back; // runs that waited when a stop came, for its answer; NULL: none
    int64_t start_ns;
    uint64_t readings;          // announced
    uint64_t stops[MOST_STOPS]; // tickets that wait for the end of a stop
    int stop_count;
    bool held; // somebody asked for the pause that the active run is in, or comes to
    bool restored; // the queue of the earlier life, so that ours may take its place on the disk
    bool ready_said, listed, ending, ended_said;
};

// --- hub_tell.c ---
void hub_publish(struct hub *h, const char *kind, json_t *data); // takes data
// To all who wait for the end of a stop, with what was put back and what is known of the light.
void hub_answer_stopped(struct hub *h, int status, json_t *o);
void hub_changed(void *ctx, const struct run *run); // its state
void hub_happened(struct hub *h, const struct note *n);
void hub_fitted(struct hub *h, const struct note *n);

// --- hub_ports.c ---
struct queue_ports hub_queue_ports(struct hub *h);
void hub_keep_queue(void *ctx); // on the disk, and told

// --- hub_requests.c ---
bool hub_is_paused(const struct hub *h, int run);
void hub_give_back(struct hub *h, struct note *n); // an answer that waited for the disk

// --- hub_mail.c ---
void hub_mail_arrived(void *ctx);
void hub_say_when_ended(struct hub *h);
