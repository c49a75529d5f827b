// SPDX-License-Identifier: MIT
// What the verbs that talk to the daemon share.
#pragma once
#include "base/err.h"
#include "base/options.h"

#include <stdbool.h>

struct json_t; // of jansson

struct remote_options {
    const char *socket;
    bool json;
};

#define REMOTE_SOCKET(type) \
    {"--socket", OPTION_TEXT, offsetof(type, remote.socket), "PATH", 0, 0, "the daemon's socket"}
#define REMOTE_JSON(type) \
    {"--json", OPTION_FLAG, offsetof(type, remote.json), NULL, 0, 0, "print JSON"}

// One request: the reply, or the exit status in *ret_status and NULL after saying what went wrong.
struct json_t *remote_call(const struct remote_options *o, const char *method, const char *path,
                           const struct json_t *body, int *ret_status);
// The same, given up soon after interrupt_fd becomes readable (client_interrupt_by).
struct json_t *remote_call_until(const struct remote_options *o, int interrupt_fd,
                                 const char *method, const char *path, const struct json_t *body,
                                 int *ret_status);

// Whether a file lies in the daemon's folder: 1 or 0; errors as client_request.
struct client;
int remote_has(struct client *c, const char *path, struct gon_error *err);
