// SPDX-License-Identifier: MIT
// One line of the control socket: a JSON object in, one out ({"ok":true,...} or {"ok":false,
// "error":"..."}). What it can ask for is a table of verbs, of which those about wires are here:
//
//   {"do":"plug","wire":W}  {"do":"unplug","wire":W}  {"do":"mute","wire":W}
//   {"do":"unmute","wire":W}
//   {"do":"set","wire":W, "drop":N (next replies lost), "delay_ms":MS (of the next reply)}
//
// Thread: the poll loop's.
#pragma once
#include "sim/wire.h"

#include <jansson.h>

struct request {
    struct wire *wires;
    int wires_count;
    void *subject; // whom it is about: the bench, an instrument
    json_t *in, *out;
    int64_t t_ns;
    char error[200]; // "" while all is well
};

struct request_verb {
    const char *verb; // NULL ends the table
    void (*run)(struct request *r);
};

struct request_key {                           // of "set"
    const char *key;                           // NULL ends the table
    void (*set)(struct request *r, json_t *v); // NULL: belongs to another key
};

// The answer to one line, with its newline, to be freed; NULL without memory. about: its wires and
// subject are used.
char *request_answer(const struct request *about, const struct request_verb *verbs,
                     const char *line, int64_t t_ns);

// For verbs.
void request_refuse(struct request *r, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
// The index of the word under a key, or -1 (refused).
int request_choice(struct request *r, const char *key, const char *const *words, int count);
bool request_truth(struct request *r, const char *key, json_t *v);
struct wire *request_wire(struct request *r);   // the one that is named, or NULL (refused)
json_t *request_wires(const struct request *r); // the state of all of them
void request_plug(struct request *r);
void request_unplug(struct request *r);
void request_mute(struct request *r);
void request_unmute(struct request *r);
// All keys of the object are known, and at least one sets something; sets in the table's order.
void request_set(struct request *r, const struct request_key *keys);
void request_set_drop(struct request *r, json_t *v);
void request_set_delay(struct request *r, json_t *v);
