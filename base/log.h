// SPDX-License-Identifier: MIT
// The log: one line, a tag first, one sentence with the numbers and their units in it. Levels are
// chosen by what the operator does: err = act, warn = look, notice = a sweep began or ended,
// info = a point, debug = bytes on the wire. Thread: any. model, fit and drivers never log.
#pragma once
#include <stdio.h>

enum log_level { LOG_ERR, LOG_WARN, LOG_NOTICE, LOG_INFO, LOG_DEBUG };

struct log; // where lines go and which are kept

// Writes to out (borrowed until log_free), with an ISO 8601 time when with_time. NULL without
// memory.
struct log *log_new(FILE *out, enum log_level most, int with_time);
void log_free(struct log *log);

// A NULL log drops the line. errno survives. Into a pipe, terminal or socket it never waits: a line
// that finds no room because nobody reads is dropped, and how many were is said before the next one.
void log_say(struct log *log, enum log_level level, const char *tag, const char *fmt, ...)
    __attribute__((format(printf, 4, 5)));
