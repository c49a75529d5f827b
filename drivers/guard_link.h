// SPDX-License-Identifier: MIT
// The daemon's end of its guard process (guard/talk.h): one laser, whose record it was given. What
// the laser says is kept until transport_guard takes it. Whoever owns the process gives the
// sockets. A guard that is gone, or does not answer in time, is replaced at the next opening or
// OFF; the new one's first bytes to the laser are OFF. Waiting gives the clock its turn. Thread:
// instrument.
#pragma once
#include "base/clk.h"
#include "base/err.h"
#include "guard/talk.h"

#include <stdbool.h>
#include <stddef.h>

struct guard_link;
struct transport;

struct guard_host { // who has the process
    // The daemon's end of a guard that was given to nobody yet; the one before is ended, if it is
    // there. The descriptor stays the host's.
    int (*connect)(void *ctx, struct gon_error *err);
    void *ctx;
    bool brief; // the laser is a simulator that ends with the daemon: not waited for afterwards
};

// NULL without memory. The host is copied, what it points to is borrowed.
struct guard_link *guard_link_new(const struct guard_host *host, const struct guard_record *record,
                                  struct clk *clk);
void guard_link_free(struct guard_link *g); // the process goes on; NULL is fine

// Hands the record over: the guard opens the port (GON_E_GONE: there is none; others as
// transport_open) and begins to switch off.
int guard_link_open(struct guard_link *g, struct gon_error *err);
// OFF until the guard read it back, at most until until_ns. GON_E_DEVICE: the laser says that it is
// on; GON_E_LINK: it does not say anything; GON_E_GONE: its port is gone. The guard goes on alone.
int guard_link_off(struct guard_link *g, int64_t until_ns, struct gon_error *err);
void guard_link_renew(struct guard_link *g); // the lease; never waits
// Hears what the guard has said; never waits. GON_E_REFUSED: it switched the laser off without
// being asked, and the text says why; GON_E_DEVICE: it is gone. 0: all is well.
int guard_link_watch(struct guard_link *g, struct gon_error *err);

// For transport_guard.c: D, A and C of guard/talk.h, with an answer within wait_ns. GON_E_GONE: the
// port is, or the guard.
int guard_link_call(struct guard_link *g, char kind, const void *bytes, size_t size,
                    int64_t wait_ns, struct gon_error *err);
size_t guard_link_take(struct guard_link *g, void *bytes, size_t size); // what the laser said
bool guard_link_ended(const struct guard_link *g);                      // that was all of a message
int64_t
guard_link_ready_ns(const struct guard_link *g); // the laser's gap after the guard's own talk
int guard_link_fd(const struct guard_link *g);   // -1: the guard is gone

// A transport over it, as transport_open over the record's link; g is borrowed. Opens nothing yet
// but what guard_link_open does.
int transport_open_guarded(struct guard_link *g, const char *link, struct clk *clk,
                           struct transport **ret_transport, struct gon_error *err);
