// SPDX-License-Identifier: MIT
// A CSV file of numbers: '#' lines are comments, the first other line names the columns, blank
// lines are skipped; CRLF, a byte-order mark and fields in double quotes are fine. Numbers have a
// decimal point, whatever the locale. Errors are GON_E_INPUT and begin with "file:line: ". Thread:
// its maker's.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stddef.h>

enum { CSV_SHOWN = 128 };

struct csv;

struct csv_field {
    const char *text; // not terminated, without blanks and quotes; until the next row
    size_t size;
};

int csv_open(const char *path, struct csv **ret_csv, struct gon_error *err); // "-": standard input
int csv_parse(const char *text, size_t size, const char *name, struct csv **ret_csv,
              struct gon_error *err);
void csv_close(struct csv *c); // NULL is fine

int csv_column(const struct csv *c, const char *name); // its index, -1: none; -2: there twice
// The index, or csv_no_column's error: a column that a file must have by this name.
int csv_need(const struct csv *c, const char *name, int *ret_column, struct gon_error *err);
// The same for a column that a person named: it is the name that may be wrong.
int csv_choose(const struct csv *c, const char *name, int *ret_column, struct gon_error *err);
// Adds to err: "no column 'NAME'" with the one that should be called so, or all there are.
// GON_E_INPUT.
int csv_no_column(const struct csv *c, const char *name, struct gon_error *err);
const char *const *csv_columns(const struct csv *c); // their names, NULL-ended; until it is closed
// At most `most` (up to 120) bytes of a name for a message, without what a terminal would obey.
const char *csv_shown(const char *name, size_t most, char text[CSV_SHOWN]);

int csv_next(struct csv *c, struct gon_error *err); // 1: a row; 0: the end; GON_E_INPUT: ragged
void csv_rewind(struct csv *c);                     // the next row is the first again
int csv_real(const struct csv *c, int column, double *ret_value, struct gon_error *err);
struct csv_field csv_text(const struct csv *c, int column);
// An error in this row's field: "file:line: COLUMN = TEXT: ...".
int csv_fail(const struct csv *c, int column, struct gon_error *err, const char *fmt, ...)
    __attribute__((format(printf, 4, 5)));
long csv_line(const struct csv *c);
