// SPDX-License-Identifier: MIT
// Question and answer in lines of text over a transport: terminators, echo, a line that says OK,
// checksums, minimum gap between commands, reassembly of partial lines, a cap on their length
// (4 KiB), and resynchronisation. Over USB an answer ends where the device says so, with its
// terminator or without; from one that has sent its terminator, an answer without it is a part of
// one.
//
// After any timeout or unreadable answer the link is out of step: a late answer would be taken for
// the next one's. So the next query first drains until quiet_ns of silence and asks a question
// whose answer is known. What came unasked before a command is dropped, and an answer with more
// behind it is not believed (one of the two is late). What no line protocol without checksum can
// see: a late double that comes after the next command was sent, and a changed digit; so drivers
// give neighbouring queries different shapes and check the range of what comes. Thread: one.
#pragma once
#include "drivers/transport.h"

#include <stdbool.h>

struct message;
struct profile_checksum;

struct message_format {
    const char *end_out;     // appended to what is sent: "\r"
    const char *end_in;      // ends an answer: "\r\n"; the bytes before it, without blanks around
    int64_t min_gap_ns;      // from an answer to the next command; 20 ms more when unanswered
    int64_t timeout_ns;      // for one answer, from the last byte sent
    int64_t quiet_ns;        // silence after which nothing more comes: the largest latency
    const char *sync_query;  // asked to get into step, with an answer of
    const char *sync_begins; // this beginning; NULL query: draining is all
    const char *echo_end;    // the device repeats the command, then this, then the answer: is
                             // checked and cut off. NULL or "": it must not repeat anything
    const char *ok_line;     // follows each answer as a line of its own; NULL or "": none
    bool empty;              // an empty line is an answer, too
    bool (*alone)(const void *ctx, const char *line); // a line (error) without an ok_line; or NULL
    const void *ctx;
    const struct profile_checksum *checksum; // of commands and answers; NULL: none
};

// Takes over the transport. The format and its strings are borrowed for the object's life and may
// be changed between calls. NULL without memory (the transport then is closed).
struct message *message_new(struct transport *t, const struct message_format *format);
void message_free(struct message *m); // closes the transport

// Sends and returns the answer without its terminator, echo, ok_line and checksum; where there is
// an echo or ok_line it may be empty. GON_E_LINK: no or no usable answer (the link resynchronises
// by itself before the next query); GON_E_GONE: unplugged; GON_E_DEVICE: the device sends back what
// it is told (echo). The text then names the query.
int message_query(struct message *m, const char *command, char *ret_answer, size_t size,
                  struct gon_error *err);
// Expects no answer.
int message_send(struct message *m, const char *command, struct gon_error *err);
// The same whatever the cancel token and the state of the link, and with at_once whatever the gap;
// for what must be said in any case. What the device answers is dropped before the next query.
int message_send_blind(struct message *m, const char *command, bool at_once, struct gon_error *err);
// The caller saw nonsense; returns GON_E_LINK.
int message_out_of_step(struct message *m, const char *why);
void message_refused(
    struct message *m); // the caller was told "error": entered into the link's book
int message_reopen(struct message *m, struct gon_error *err); // one try; also gets into step

// A query that may be repeated: up to 3 times while the link fails or read says that the answer is
// nonsense (non-zero; it fills what ctx points to, and may fill err).
int message_ask(struct message *m, const char *command,
                int (*read)(const char *answer, void *ctx, struct gon_error *err), void *ctx,
                struct gon_error *err);
int message_ask_number(struct message *m, const char *command, double *ret_value,
                       struct gon_error *err);
int message_ask_text(struct message *m, const char *command, char *ret_text, size_t size,
                     struct gon_error *err);

struct transport *message_transport(const struct message *m);
const struct link_stats *message_stats(const struct message *m);

// A number as instruments write it: optional sign, digits, decimal point, exponent of any length;
// the whole text but for blanks. A comma, "nan", "inf", 9.9e37 (overflow) or anything left over is
// an error. Independent of the locale; correct to one unit in the last place.
int message_number(const char *text, double *ret_value, struct gon_error *err);
// The same, but 9.9e37 is a number like any other: what it means is left to the caller.
int message_decimal(const char *text, double *ret_value, struct gon_error *err);
