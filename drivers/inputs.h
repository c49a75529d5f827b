// SPDX-License-Identifier: MIT
// What a bench watches: a door, limit switches, temperatures, by a profile whose role is "inputs";
// and a relay that drops out when nobody keeps it on. All values come in one look; when a look
// fails none of them is known any more, as what was true before may not be so now. Thread:
// instrument.
//
// The relay: the profile's watchdog write has to go out at most watchdog_ms apart, or the device
// itself drops it. inputs_keep sends it when half of that has gone; it is called from every wait.
// So the relay dies with the program, whatever it died of. Freeing sends nothing.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct bus;
struct inputs;
struct link_stats;
struct profile;

struct inputs_value {
    const char *name, *unit, *help; // the profile's
    double number;                  // NAN unless known, and for a text
    bool known;
};

// The profile is borrowed for the object's life, and so is the bus. Opens the link only. NULL
// without memory.
struct inputs *inputs_on_bus(const struct profile *p, struct bus *bus, int unit, struct clk *clk);
// A device of its own link, as session_open.
int inputs_open(const struct profile *p, const char *link, struct clk *clk,
                const struct cancel *cancel, struct inputs **ret_inputs, struct gon_error *err);
void inputs_free(struct inputs *in);
int inputs_reopen(struct inputs *in, struct gon_error *err); // on a bus: its owner reopens that

// Asks who it is; ret_text says it. Nothing is written to what is another kind of unit.
int inputs_identify(struct inputs *in, char *ret_text, size_t size, struct gon_error *err);
// One look at all of them. GON_E_LINK, GON_E_GONE, GON_E_DEVICE: none is known then.
int inputs_read(struct inputs *in, struct gon_error *err);
int64_t inputs_read_ns(const struct inputs *in); // when the last look succeeded; INT64_MIN: never

int inputs_count(const struct inputs *in);
struct inputs_value inputs_at(const struct inputs *in,
                              int index); // 0..count-1, the profile's order
bool inputs_find(const struct inputs *in, const char *name, struct inputs_value *ret_value);
// Of its own link; NULL on a bus, whose book its owner has.
const struct link_stats *inputs_stats(const struct inputs *in);
// A condition over them (profile_when.h): false while a value in it is not known.
bool inputs_hold(const struct inputs *in, const char *condition);

// Keeps the relay on, when it is time. An error means that it may drop.
int inputs_keep(struct inputs *in, struct gon_error *err);
