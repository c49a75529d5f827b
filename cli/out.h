// SPDX-License-Identifier: MIT
// How the command speaks: data on stdout, talk on stderr; colour and live lines only on a terminal
// and not with NO_COLOR; tables aligned on a terminal and tab-separated in a pipe.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct json_t; // of jansson

bool out_colour(FILE *out);  // a terminal, and NO_COLOR is not set
bool out_is_terminal(FILE *out);
int out_columns(FILE *out);  // width of the terminal; 80 when it is not known

enum out_style { OUT_PLAIN, OUT_BOLD, OUT_DIM, OUT_RED, OUT_GREEN, OUT_YELLOW };
const char *out_begin(FILE *out, enum out_style style); // "" without colour
const char *out_end(FILE *out);

void out_say(const char *fmt, ...) __attribute__((format(printf, 1, 2)));  // "gonio: ..." on stderr
void out_warn(const char *fmt, ...)
    __attribute__((format(printf, 1, 2))); // "warning: ..." on stderr

// "0.0317 ±0.0006": as many decimals as the first digit of u needs; without u, four digits.
void out_value(char *text, size_t size, double value, double u);

// A time to go by: "40 s", "12 min", "3 h 05 min"; finite.
void out_duration(char *text, size_t size, double s);
// "2026-11-26 14:05" where we are; "" for 0.
void out_local(int64_t utc_ms, char *text, size_t size);

// Says the error and returns the exit status that its code stands for.
int out_fail(const struct gon_error *err);

void out_json(const struct json_t *o);      // indented, with a newline, on stdout
void out_json_line(const struct json_t *o); // one line, flushed
// A text as JSON; where it is no UTF-8, as a file's name may be, with ? for what is not ASCII.
struct json_t *out_json_text(const char *text);

// Writes what stdout still holds; EXIT_FAILED when it could not be written, else status.
int out_finish(int status);

// A table: cells are collected row by row and printed at the end.
struct table;
struct table *table_new(int columns); // never NULL: ends the program without memory
void table_cell(struct table *t, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
void table_right(struct table *t, int column);       // aligned to the right
void table_print(struct table *t, FILE *out); // the first row is the heading; frees the table
