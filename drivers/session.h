// SPDX-License-Identifier: MIT
// A live instrument by its profile: questions and settings in the profile's own names, over a text
// link (drivers/message.h) or as one unit of a Modbus bus (drivers/bus.h). Roles (laser_profile,
// detector_profile, axis_profile, selector_profile) are made of these calls and know nothing of
// bytes or registers.
//
// What comes is believed only when it fits its pattern, lies in its range and holds to the
// exchange's "believe" (as far as all values in that are known); otherwise the link is out of step
// and it is asked again, up to 3 times. A setting is sent once, and what verifies it is
// asked afterwards; where its answer was lost and the read-back shows that it did not arrive, it is
// sent up to 2 times more. Neighbouring Modbus reads get different lengths, so that a late answer
// fails its length check. Thread: the instrument's.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "drivers/profile_data.h"

#include <stddef.h>
#include <stdint.h>

struct bus;
struct session;
struct message;
struct transport;

// The profile is borrowed for the session's life. Opens the link only and sends nothing.
int session_open(const struct profile *p, const char *link, struct clk *clk,
                 const struct cancel *cancel, struct session **ret_session, struct gon_error *err);
// Over a transport that is open, which is taken over, also when it fails.
int session_over(const struct profile *p, struct transport *transport,
                 struct session **ret_session, struct gon_error *err);
// Over a bus, which is borrowed. NULL without memory.
struct session *session_on_bus(const struct profile *p, struct bus *bus, int unit);
void session_free(struct session *s);
// Whatever was learnt of the instrument is forgotten, as another one may be there. Of a bus:
// nothing is opened, its owner does it.
int session_reopen(struct session *s, struct gon_error *err);

const struct profile *session_profile(const struct session *s);
const char *session_link(const struct session *s);
struct message *session_message(const struct session *s); // NULL on a bus
struct profile_data *session_data(struct session *s);     // to look at and to set what is sent
// Sets a value that is to be sent; names the profile lacks, and "", are ignored.
void session_put(struct session *s, const char *name, double number);
double session_number(const struct session *s, const char *name); // NAN: not known
bool session_holds(const struct session *s, const char *condition);
// Which values the asks bring: ret_gives[value] is set to true; others stay.
void session_gives(const struct profile *p, const struct profile_asks *asks,
                   bool ret_gives[PROFILE_VALUES]);

// All of them, or an error: GON_E_LINK, GON_E_GONE, GON_E_DEVICE (refused; exception answer).
int session_ask(struct session *s, const struct profile_asks *asks, struct gon_error *err);
int session_ask_one(struct session *s, const char *name, struct gon_error *err);
// One try, for when telling again is worth more than asking again.
int session_ask_once(struct session *s, const struct profile_asks *asks, struct gon_error *err);
// An exchange or write that sets something. params: $NAMEs of a write; NULL. GON_E_INPUT: a value
// beyond its range, nothing was sent. GON_E_REFUSED or GON_E_DEVICE: it was refused
// (session_meaning says how), or reads back another value. GON_E_LINK: the answer was lost and the
// read-back, where there is one, does not show it.
int session_send(struct session *s, const char *name, const struct profile_param *params,
                 struct gon_error *err);
// Message only: sent whatever was cancelled and whatever the link's state; at_once: whatever the
// gap.
int session_send_blind(struct session *s, const char *text, bool at_once, struct gon_error *err);

enum profile_meaning session_meaning(const struct session *s); // of the last refusal
// Asks who it is and applies the profile's "refuse"; ret_title as the profile makes it.
int session_identify(struct session *s, char *ret_title, size_t size, struct gon_error *err);
bool session_restarted(struct session *s); // seen since the last call: true once
