// SPDX-License-Identifier: MIT
// The command's end of the daemon's HTTP: JSON requests over the Unix socket, and the event stream,
// which reconnects and goes on after the last event it saw. Thread: one.
#pragma once
#include "base/err.h"

#include <stdbool.h>

struct client;
struct json_t; // of jansson

// socket NULL: where paths_socket says. Connects to nothing yet.
int client_new(const char *socket, struct client **ret_client, struct gon_error *err);
void client_free(struct client *c);
const char *client_socket(const struct client *c);

// body NULL: none. The reply is the caller's to json_decref. GON_E_GONE: no daemon; GON_E_INPUT:
// 400, 404, 413, 422; GON_E_REFUSED: 409, 429, 503; GON_E_SYSTEM: anything else. err then holds
// what the daemon said, where, and what to do.
int client_request(struct client *c, const char *method, const char *path,
                   const struct json_t *body, struct json_t **ret_reply, struct gon_error *err);
// From now on, requests give up (GON_E_CANCELED) when fd is readable and 2 s later no answer is
// there: what was asked for may then be done or not. -1: they wait.
void client_interrupt_by(struct client *c, int fd);

#define CLIENT_AWAY_NS 10000000000 // how long a daemon that is followed may be away

struct client_follower {
    void *ctx;
    bool (*event)(void *ctx, const struct json_t *event); // false: enough
    void (*away)(void *ctx);                               // the connection broke
    bool (*back)(void *ctx); // it is there again, events may be missing; false: enough
};

// Follows the events after last_id until the follower has enough (0), fd interrupt_fd becomes
// readable (GON_E_CANCELED), the daemon has no stream to give (GON_E_REFUSED), or it stays away
// (GON_E_GONE). The follower may use other clients meanwhile, not this one.
int client_follow(struct client *c, const char *last_id, int interrupt_fd,
                  const struct client_follower *follower, struct gon_error *err);
