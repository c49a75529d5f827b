// SPDX-License-Identifier: MIT
// The one place that commands emission. It takes the laser over, so that nobody else can: there is
// no other way to it than these calls. Thread: instrument.
//
//  - before anything else is sent to a laser it is switched off and that is read back
//  (safety_begin);
//  - on only while a run has permission (safety_permit), the laser is armed (safety_arm) and the
//    interlock reads closed; sent once. An arm that ends while emission is on raises the alarm, see
//    below;
//  - off is sent until it was read back, at most for SAFETY_OFF_S; when that fails the answer is
//    GON_E_DEVICE and "LASER MAY BE ON", and the rule "off" stays in force: every later tick of an
//    idle instrument tries again (safety_pending);
//  - a stop is obeyed whatever the thread waits for (safety_obey): the next tick tells that off is
//    due, once for each stop; whoever ends the run repeats it until it is read back;
//  - emission is a lease: while it is on, whoever waits calls safety_tick at least every 200 ms.
//    With a guard process (safety_guard) that renews the lease: 500 ms of silence, or our death,
//    and the guard switches off. Then, after gonio laser off, when the guard itself is gone, and
//    when the arm ended, the alarm stands (safety_alarm), off is due, and on is refused until the permission is taken
//    back (again); without permission off is pending. A laser with a lease of its own (keep_alive)
//    is told in the same tick, and no longer once off was sent: it goes off by itself when this
//    thread hangs.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"
#include "drivers/laser.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct arm;
struct guard_link;
struct link_stats;
struct safety;

// What may be said of the light, and nothing better.
enum safety_light {
    SAFETY_LIGHT_OFF,         // the last off was read back, and no on was sent since
    SAFETY_LIGHT_UNCONFIRMED, // the last off was not read back; no on since the last that was
    SAFETY_LIGHT_MAYBE        // on was sent, and no off was read back since
};

#define SAFETY_OFF_S 1.5          // how long one safety_off tries
#define SAFETY_TICK_MOST_MS 200.0 // the longest silence allowed while emission is on

// Takes over laser, also when it fails (then the laser is freed). NULL without memory.
struct safety *safety_new(struct laser *laser, struct clk *clk);
// The guard that holds the laser's port, borrowed: it does the switching off and reads it back.
// Without one the laser's driver does; that is for tests.
void safety_guard(struct safety *s, struct guard_link *guard);
// Who armed the laser, borrowed; its owner steps it on this thread. NULL, as at first: nobody.
void safety_arm(struct safety *s, const struct arm *arm);
// Off first, as well as the link allows; false when it was not read back. NULL is fine.
bool safety_free(struct safety *s);

// First contact, and after every reopening: off with read back, then who it is. ret_text may be
// NULL.
int safety_begin(struct safety *s, char *ret_text, size_t size, struct gon_error *err);
// One try at the link, then safety_begin.
int safety_reopen(struct safety *s, char *ret_text, size_t size, struct gon_error *err);

// A run begins or ends; ending sends nothing itself, and forgets the alarm.
void safety_permit(struct safety *s, bool running);
int safety_set_power(struct safety *s, double power_w, struct gon_error *err);

// GON_E_REFUSED: no running campaign, not armed, interlock open, key; GON_E_DEVICE: fault. Accepted is not
// light.
int safety_on(struct safety *s, struct gon_error *err);
int safety_off(struct safety *s, struct gon_error *err);

// The token of a stop, borrowed until the next call; NULL: none.
void safety_obey(struct safety *s, const struct cancel *stop);
// Renews the lease; costs nothing while emission is off. True when off is due: a stop was asked for
// with the light on, or the guard raised the alarm, and the laser is not being talked to.
bool safety_tick(struct safety *s);
// What the guard did without being asked, or that it is gone, or that the arm ended in the light,
// since the last end of a run: 0, or
// GON_E_REFUSED or GON_E_DEVICE.
int safety_alarm(const struct safety *s, struct gon_error *err);

int safety_status(struct safety *s, struct laser_status *ret_status, struct gon_error *err);
// One short question: whether the laser says that light comes out.
int safety_look(struct safety *s, bool *ret_emission, struct gon_error *err);
const char *safety_fault_text(const struct safety *s, int code);
const struct link_stats *safety_stats(const struct safety *s); // NULL: the laser has no link

enum safety_light safety_light(const struct safety *s);
// "laser off", or a warning with what to do; one clause, no full stop.
const char *safety_light_text(enum safety_light light);
bool safety_emission(const struct safety *s);        // on was sent and off was not read back since
bool safety_pending(const struct safety *s);         // an off that was not confirmed
int64_t safety_worst_gap_ns(const struct safety *s); // between ticks, while emission was on
