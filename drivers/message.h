// SPDX-License-Identifier: MIT
// Question and answer in lines of text over a transport: terminators, echo, minimum gap between
// commands, reassembly of partial lines, a cap on their length, and resynchronisation.
//
// After any timeout or unreadable answer the link is out of step: a late answer would be taken for the
// next one's. So the next query first drains and asks a question whose answer is known. Thread: one.
#pragma once
#include "drivers/transport.h"

struct message;

struct message_format {
    const char *end_out;    // appended to what is sent: "\r"
    const char *end_in;     // ends an answer: "\r\n"; bytes before it are the answer, blanks at its ends cut
    int64_t min_gap_ns;     // between an answer (or a command) and the next command
    int64_t timeout_ns;     // for one answer, from the last byte sent
    int64_t quiet_ns;       // silence that proves nothing more is coming: the device's largest latency
    const char *sync_query; // asked to get into step, with an answer of
    const char *sync_begins; // this beginning; NULL query: draining is all
};

// Takes over the transport. The format's strings are borrowed for the object's life.
struct message *message_new(struct transport *t, const struct message_format *format);
void message_free(struct message *m); // closes the transport

// Sends and returns the answer without its terminator. GON_E_LINK: no or no usable answer (the link
// resynchronises by itself before the next query); GON_E_GONE: unplugged; text then names the query.
int message_query(struct message *m, const char *command, char *ret_answer, size_t size,
                  struct gon_error *err);
int message_send(struct message *m, const char *command, struct gon_error *err); // expects no answer
int message_out_of_step(struct message *m, const char *why); // the caller saw nonsense; returns GON_E_LINK
int message_reopen(struct message *m, struct gon_error *err);
const struct transport_stats *message_stats(const struct message *m);

// A number as instruments write it: optional sign, digits, decimal point, exponent of any length; the
// whole text but for blanks. A comma, "nan", "inf", 9.9e37 (overflow) or anything left over is an error.
int message_number(const char *text, double *ret_value, struct gon_error *err);
