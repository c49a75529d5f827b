// SPDX-License-Identifier: MIT
// What is wrong with a device, in the words of somebody who stands at the bench: what, why, and
// what to do. Pure: errors and states in, text out. Thread: any.
#pragma once
#include "base/err.h"
#include "drivers/link.h"

#include <stdbool.h>
#include <stddef.h>

struct laser_status;

enum finding_level {
    FINDING_WELL,
    FINDING_LOOK, // good to know; gonio copes with it
    FINDING_WRONG
};

struct finding {
    enum finding_level level;
    char who[64];                        // "laser", "axis theta_r", "bus axes", "goniod"
    char what[520], why[320], todo[720]; // "": nothing to say
};

const char *finding_level_name(enum finding_level level); // "well", "look", "WRONG"

// Each fills level, what, why and todo, and leaves who.
void explain_well(struct finding *f, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
void explain_look(struct finding *f, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

// It could not be opened. ports: which serial ports there are, a sentence (ports_text).
void explain_open(struct finding *f, const struct gon_error *err, const struct link *l,
                  const char *ports);
// It was opened, and what came is no answer of the expected driver, or nothing came.
void explain_talk(struct finding *f, const struct gon_error *err, const struct link *l,
                  const char *expected);
// Another of the bench's devices answers there: identity is what it said, is and expected the
// parts' names ("detector", "laser"), link the expected one's.
void explain_instead(struct finding *f, const char *identity, const char *is, const char *expected,
                     const char *link);
// A unit of a bus is silent while others (their numbers as text) answer.
void explain_unit(struct finding *f, int unit, const char *others);
// No unit of a bus answers; units: those asked.
void explain_bus(struct finding *f, const struct link *l, const char *link, const char *units);

void explain_emission(struct finding *f); // OFF is not confirmed
void explain_relit(struct finding *f);    // it emitted after OFF, and was switched off again
void explain_alarm(struct finding *f, int code, const char *text);
void explain_home(struct finding *f);
void explain_no_reference(struct finding *f);
// False when nothing keeps the laser from emitting when a run wants it.
bool explain_laser(struct finding *f, const struct laser_status *s, const char *fault_text);

// The settings of a serial link as on a panel: "115200 baud, parity E, 1 stop bit"; "" of others.
void explain_settings(const struct link *l, char *ret_text, size_t size);
