// SPDX-License-Identifier: MIT
// Command lines, checked against a table: --name VALUE, --name=VALUE, --flag; -h is --help; "--"
// ends the options; everything else is an operand. A mistake is one sentence with what was meant,
// if that can be guessed. Texts are borrowed from argv. Thread: any.
#pragma once
#include "base/err.h"

#include <stddef.h>
#include <stdio.h>

enum option_type {
    OPTION_FLAG, // bool
    OPTION_TEXT, // const char *
    OPTION_INT,  // long
    OPTION_REAL  // double
};

struct option_row {
    const char *name; // "--seed"; NULL ends the table
    enum option_type type;
    size_t offset;     // of the member in the target, which holds the defaults before
    const char *value; // what --help calls the value: "N", "FILE"; NULL for a flag
    double min, max;   // inclusive, OPTION_INT and OPTION_REAL; equal: any
    const char *help;  // one sentence without its full stop
};

// argv[0] is skipped. Returns the count of operands, put in order into operands, or GON_E_INPUT
// when an option is unknown or wrong or there are more than most operands.
int options_take(int argc, char **argv, const struct option_row *rows, void *target,
                 const char **operands, int most, struct gon_error *err);

void options_describe(FILE *out, const struct option_row *rows); // for --help
void options_manual(FILE *out, const struct option_row *rows);   // the same as scdoc text
// Words in lines of at most 79 columns, from a column that out has reached; ends the last line.
void options_fill(FILE *out, const char *text, int column);

// Which of the words (NULL at their end) may have been meant by a mistyped one; NULL when none is
// near.
const char *options_suggest(const char *typed, const char *const *words);

// A whole text as a number with a decimal point, whatever the locale: 0, or GON_E_INPUT.
int options_real(const char *text, double *ret_value);
