// SPDX-License-Identifier: MIT
// Configuration: libconfig syntax, checked against a table. One row a setting: name, type, unit,
// range, default, help; the parser, `gonio check` and the man pages all come from that table.
//
// Every mistake is reported, not only the first, as
//     file:line: path = value: what is wrong; allowed 0..85 deg
//     file:line: unknown setting 'stpe' in campaign.theta_r; did you mean 'step_deg'?
// and nothing is half-applied: the target is filled only when the whole file is right. Integers are
// accepted for reals. '@include' is refused before parsing (it opens any path and hangs on a FIFO),
// as is a path that is not a regular file or is larger than 1 MiB. Strings are UTF-8 and copied
// into the target's arrays; a longer one is an error, never cut. Thread: any; a cfg_file belongs to
// its maker.
#pragma once
#include <stddef.h>
#include <stdio.h>

enum cfg_type {
    CFG_STRING, // char[size]
    CFG_BYTES,  // the same, and control characters may be in it ("\r\n", "\x1b")
    CFG_INT,    // int
    CFG_HEX,    // uint32_t, decimal or hexadecimal (0x007E)
    CFG_REAL,   // double
    CFG_BOOL,   // bool
    CFG_CHOICE, // int: index into choices
    CFG_REALS,  // double[size], count at count_offset; [ ] or ( ) in the file, a single number is a
                // list of one
    CFG_CHOICES, // int[size], count at count_offset: the same of choices
    CFG_STRINGS, // char[size][stride], count at count_offset; control characters may be in them; a
                 // single text is a list of one
    CFG_PAIRS,   // double[size][2], count at count_offset; ( (a, b), (a, b) ) in the file
    CFG_GROUP,  // nested struct: { }
    CFG_GROUPS  // array of structs: ( { }, { } )
};

struct cfg_row {
    const char *name;
    enum cfg_type type;
    size_t offset;        // of the member in its struct
    size_t size;          // CFG_STRING, CFG_BYTES bytes; lists: the most elements
    const char *unit;     // "deg", "s", ... NULL: none
    double min, max;      // inclusive; numbers and lists of them; equal: any
    const char *fallback; // default, as written in a file; NULL: must be given; groups: "" or NULL
    const char *help;     // one sentence
    const char *const *choices; // CFG_CHOICE and CFG_CHOICES, NULL at its end
    const struct cfg_row *rows; // CFG_GROUP, CFG_GROUPS; a row without name ends a table
    size_t stride;              // CFG_GROUPS, CFG_STRINGS: sizeof one element
    size_t count_offset;        // lists: of the int that gets the count
};

// Who hears of mistakes: one call a line, without newline. NULL say: nobody.
struct cfg_sink {
    void (*say)(void *ctx, const char *line);
    void *ctx;
};

struct cfg_file; // a parsed file that remembers its lines

// NULL when it cannot be read or parsed; the reason went to the sink, whose content must outlive
// the file.
struct cfg_file *cfg_open(const char *path, struct cfg_sink sink);
// The same from a text; name stands where the path would in messages.
struct cfg_file *cfg_parse(const char *text, const char *name, struct cfg_sink sink);
void cfg_close(struct cfg_file *f);

// Checks the whole file against the table and, if it is right, fills target. Returns the number of
// mistakes, 0 when target was filled (all of it: defaults included).
int cfg_take(struct cfg_file *f, const struct cfg_row *schema, void *target);

// For checks across settings: reports "file:line: path = value: text" and counts as one mistake.
// Path: "campaign.theta_r.from_deg", "axes[1].unit". Returns 1.
int cfg_complain(struct cfg_file *f, const char *path, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));

// The file as it was read, for snapshots; until cfg_close.
const char *cfg_text(const struct cfg_file *f);

// Writes the table as scdoc (man page) text.
void cfg_describe(FILE *out, const struct cfg_row *schema);
