// SPDX-License-Identifier: MIT
// Suspenders: conditions under which a run may not go on. A part of the bench file; man
// goniod.cfg(5) is printed from its table. What they do to a run is daemon/suspend.h. Thread: any.
//
// The conditions are written as those of a profile (gonio-profile(5)), over numbers of several
// devices: terms joined by "and",
//
//   door.open                  is not 0             not room.water_ok          is 0
//   room.temperature_c > 25    also = != < <= >=
//
// A name is DEVICE.VALUE of one of the devices whose use is inputs, or one of bench_own_values. The
// other way round than in a profile, a term about a value that is not known holds: what must be
// seen to go on was then not seen.
#pragma once
#include "base/cfg.h"
#include "base/err.h"

#include <stdbool.h>

enum { BENCH_SUSPENDERS = 12, BENCH_TERMS = 4, BENCH_TERM = 64, BENCH_WHEN = 160 };

enum bench_resume { BENCH_MANUAL, BENCH_AUTOMATIC };

struct bench_suspender {
    char name[32]; // "too warm", "door"
    char when[BENCH_WHEN];
    double settle_s; // it must not hold for so long before the run goes on
    int resume;      // enum bench_resume
};

enum bench_sign {
    BENCH_SET, // not 0
    BENCH_NOT_SET,
    BENCH_EQUAL,
    BENCH_UNEQUAL,
    BENCH_LESS,
    BENCH_LESS_EQUAL,
    BENCH_MORE,
    BENCH_MORE_EQUAL
};

struct bench_term {
    char name[BENCH_TERM];
    enum bench_sign sign;
    double limit; // 0 of BENCH_SET and BENCH_NOT_SET
};

struct bench_condition { // all of them
    struct bench_term term[BENCH_TERMS];
    int terms;
};

extern const struct cfg_row bench_suspender_rows[];
extern const char *const bench_own_values[]; // NULL at the end

struct bench_config;

// GON_E_INPUT with what is wrong in it. Names are not looked up.
int bench_condition_parse(const char *when, struct bench_condition *ret_condition,
                          struct gon_error *err);
// Whether it holds for this value; NAN: not known, which holds.
bool bench_term_holds(const struct bench_term *t, double value);
// "room.temperature_c = 26.4 > 25", "door.open = 1", "door.open is not known".
void bench_term_text(const struct bench_term *t, double value, char *text, size_t size);
// The device of a DEVICE.VALUE, as an index into devices; *ret_value is behind the dot. -1: a value
// of our own, or no such device.
int bench_term_device(const struct bench_config *b, const struct bench_term *t,
                      const char **ret_value);
bool bench_term_is(const struct bench_term *t, const char *own_value);
// Only the light tells it: monitor_v, laser_power_w.
bool bench_term_needs_light(const struct bench_term *t);

// Checks across settings: reports each mistake with its line. Returns how many. What values a
// device has only its profile says: gonio check looks there.
int bench_suspend_check(struct cfg_file *f, const struct bench_config *b);
