// SPDX-License-Identifier: MIT
// Errors: what went wrong, with whom, with which numbers, and what to do next.
//
// Functions return 0 (or a count) on success and a negative gon_code on failure; the text goes into
// an optional struct gon_error passed last. Codes are few and chosen by what the caller does about
// them. A function either returns an error or logs it, never both. Outputs named ret_* are written
// only on success. Thread: any; a struct gon_error belongs to its caller.
#pragma once

enum gon_code {
    GON_OK = 0,
    GON_E_INPUT = -1,    // a file, an argument or a setting is wrong: mend it (exit status 2)
    GON_E_LINK = -2,     // no answer, or one that cannot be trusted: resynchronise and retry
    GON_E_GONE = -3,     // unplugged, hung up, no such port: wait and reopen
    GON_E_DEVICE = -4,   // the device refuses or reports a fault: an operator must look
    GON_E_REFUSED = -5,  // busy, interlock, in use by somebody else (exit status 4)
    GON_E_CANCELED = -6, // somebody asked to stop
    GON_E_STORE = -7,    // the database or its disk
    GON_E_SYSTEM = -8    // memory, descriptors, threads
};

struct gon_error {
    enum gon_code code;
    char text[480]; // one line, no newline at its end, "" when nothing was said
};

// Fills err (NULL is fine) and returns code, so that a failure is one statement: return
// gon_fail(...).
int gon_fail(struct gon_error *err, enum gon_code code, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));

// Puts "who: " before the text that is there ("axis theta_r: no answer in 100 ms"); returns err's
// code, or GON_E_SYSTEM when err is NULL. Text that no longer fits is cut at its end.
int gon_prefix(struct gon_error *err, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

// "input", "link", "gone", ... for logs and JSON; "ok" for 0.
const char *gon_code_name(enum gon_code code);
