// SPDX-License-Identifier: MIT
// One laser; made by by_profile.h. Only daemon/safety calls emission; everything else only reads.
// Opening one sends nothing: call off first, then identify. Gaps between commands are kept through
// the clock, which so gets its turn. Thread: instrument (later the guard process owns the port).
//
// off: sent with a leading terminator so that a half-sent command cannot swallow it, repeated after
//      the laser's minimum gap until the read-back says off; safe at any time, any number of times.
// on:  sent once, never repeated by a driver; accepted is not light: poll status.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"

#include <stdbool.h>
#include <stddef.h>

struct laser;
struct link_stats;

enum laser_state {
    LASER_OFF,
    LASER_WARMING,   // on its way: temperatures, delay by regulation
    LASER_EMITTING,  // at its set-point
    LASER_INTERLOCK, // open
    LASER_NEEDS_KEY, // an operator must cycle the key
    LASER_FAULT
};

struct laser_status {
    enum laser_state state;
    bool emission; // the laser says that light comes out, or may at any moment
    bool interlock_closed;
    double power_w; // as the laser measures it; NAN when it does not
    double setpoint_w;
    int fault_code; // 0: none
};

struct laser_ops {
    int (*identify)(struct laser *l, char *ret_text, size_t size, struct gon_error *err);
    // Everything, asked now. Cobolt: 5 commands (6 the first time), 0.1 s each.
    int (*status)(struct laser *l, struct laser_status *ret_status, struct gon_error *err);
    // As few commands as possible (Cobolt: one, 0.1 s): whether the laser says that light comes
    // out.
    int (*emission)(struct laser *l, bool *ret_emission, struct gon_error *err);
    int (*set_power)(struct laser *l, double power_w, struct gon_error *err); // read back
    // GON_E_REFUSED: interlock open, key; GON_E_DEVICE: fault, or it does not want to.
    int (*on)(struct laser *l, struct gon_error *err);
    // 0 only when read back, and no start sequence goes on. Never minds the cancel token.
    // GON_E_DEVICE: told 6 times and it still emits ("LASER MAY BE ON"). Cobolt: sent at once,
    // confirmed 0.35 s later.
    int (*off)(struct laser *l, struct gon_error *err);
    // Renews the lease that the laser itself gives, when that is due; called while emission is on
    // by whoever renews ours, at least every 200 ms, and never else. NULL: the laser gives none.
    int (*keep_alive)(struct laser *l, struct gon_error *err);
    int (*reopen)(struct laser *l, struct gon_error *err);
    const char *(*fault_text)(struct laser *l, int code);
    const struct link_stats *(*stats)(const struct laser *l); // NULL: it has no link
    void (*free)(struct laser *l);
};

struct laser {
    const struct laser_ops *ops; // first member of each driver's own struct
};

const char *laser_state_name(enum laser_state s); // "off", "warming", "emitting", ...
