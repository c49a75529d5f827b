// SPDX-License-Identifier: MIT
// HTTP/1.1 over the daemon's Unix socket: requests with small bodies, answered at once or later,
// and streams of server-sent events. Thread: main; never blocks.
//
// Limits: 32 connections (503 beyond, but never for a stop; 512 in all, silent ones included), 8
// streams (503), 64 KiB of body (413), 8 KiB of header (431), 12 s of silence. A request with both
// Content-Length and Transfer-Encoding, or with two lengths, is 400: the library would accept it,
// and two readers could understand it differently.
#pragma once
#include "base/err.h"
#include "daemon/events.h"

#include <stddef.h>
#include <stdint.h>

#define HTTP_STOP_PATH "/api/v1/stop"
// Who asks, as they call themselves: percent-encoded UTF-8, at most 64 bytes when decoded.
#define HTTP_NAME_HEADER "Gonio-Name"
enum { HTTP_NAME = 65 };

struct http;
struct log;
struct loop;

struct http_request {
    const char *method, *path; // path without its query
    const char *body;          // NUL-terminated; may hold NULs before its end
    size_t size;
    long pid, uid;             // of the peer, as the kernel says; -1 unknown
    const char *name;          // as they call themselves, printable; "" when they do not
};

enum { HTTP_LATER = 0, HTTP_STREAM = -1 };

struct http_reply {
    int status;        // HTTP status; HTTP_LATER: http_answer will follow; HTTP_STREAM: send events
    char *body;        // text, malloc'ed, taken over; NULL only with the two special ones
    const char *allow; // static text for the Allow header; NULL: none
    const char *type;  // static text for Content-Type; NULL: application/json
};

struct http_ports {
    void *ctx;
    struct http_reply (*request)(void *ctx, const struct http_request *request, uint64_t ticket);
};

// Serves the listening socket (borrowed) on the loop; streams read from events (borrowed).
struct http *http_new(struct loop *loop, int listen_fd, const struct events *events,
                      const struct http_ports *ports, struct log *log, struct gon_error *err);
void http_free(struct http *h); // ends all connections; requests that wait are answered with 503

// Answers a request left for later; does nothing when its client has gone. Body as in http_reply.
void http_answer(struct http *h, uint64_t ticket, int status, char *body);
void http_wake(struct http *h); // events were added

// {"error": what, "where": where, "what_to_do": what_to_do} as malloc'ed text; where may be NULL.
char *http_error(const char *error, const char *where, const char *what_to_do);
