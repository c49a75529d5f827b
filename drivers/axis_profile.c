// SPDX-License-Identifier: MIT
// An axis by its profile (struct profile_axis): which values tell its state and which writes move
// it stands there; what is repeated, what never is, and in which order stands here.
#include "drivers/by_profile.h"

#include "drivers/axis.h"
#include "drivers/bus.h"
#include "drivers/session.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct profiled_axis {
    struct axis axis; // first
    struct session *s;
    const struct profile_axis *is;
    struct bus *bus;
    int unit;
    bool moved; // target was acknowledged
    int32_t target;
    int64_t kept_ns; // when its watchdog was last told
};

static struct profiled_axis *axis_of(struct axis *a)
{
    return (struct profiled_axis *)a;
}

static int send_if_any(struct profiled_axis *z, const char *name, struct gon_error *err)
{
    return *name ? session_send(z->s, name, NULL, err) : 0;
}

// --- status --------------------------------------------------------------------------------------

// A condition that the profile does not have does not hold, where profile_when would say yes.
static bool holds(const struct profiled_axis *z, const char *condition)
{
    return *condition && session_holds(z->s, condition);
}

static int32_t steps(double number)
{
    return isfinite(number) ? (int32_t)lround(number) : 0;
}

// While it moves, a command position is where its profile of speeds is, not where it leads: then
// the target is that of the last move that was acknowledged.
static struct axis_status look(const struct profiled_axis *z)
{
    const struct profile_axis *is = z->is;
    const double code = session_number(z->s, is->alarm_code);
    struct axis_status s = {
        .position_steps = steps(session_number(z->s, is->position)),
        .target_steps = steps(session_number(z->s, *is->target ? is->target : is->position)),
        .moving = holds(z, is->moving),
        .homed = holds(z, is->homed),
        .alarm = holds(z, is->alarm),
        .limit = holds(z, is->limit),
        .following = holds(z, is->following),
        .alarm_code = steps(code),
    };
    s.alarm = s.alarm || s.alarm_code != 0;
    s.in_position = *is->in_position ? holds(z, is->in_position) : !s.moving;
    s.ready = *is->ready ? holds(z, is->ready) : !s.alarm;
    if (s.moving && z->moved)
        s.target_steps = z->target;
    return s;
}

// Told with the status, as that is asked all the time; at half its time, so that one may be late.
static int keep_watchdog(struct profiled_axis *z, struct gon_error *err)
{
    const int64_t now_ns = bus_now_ns(z->bus);
    if (!*z->is->watchdog || (double)(now_ns - z->kept_ns) < 0.5e6 * z->is->watchdog_ms)
        return 0;
    int rc = session_send(z->s, z->is->watchdog, NULL, err);
    if (rc == 0)
        z->kept_ns = now_ns;
    return rc;
}

static int status(struct axis *a, struct axis_status *ret_status, struct gon_error *err)
{
    struct profiled_axis *z = axis_of(a);
    int rc = keep_watchdog(z, err);
    if (rc == 0)
        rc = session_ask(z->s, &z->is->status, err);
    if (rc == 0 && !isfinite(session_number(z->s, z->is->position)))
        return gon_fail(err, GON_E_DEVICE, "%s: it does not know its position", session_link(z->s));
    if (rc == 0)
        *ret_status = look(z);
    return rc;
}

// Who it is and how; nothing is written to what is another kind of unit.
static int identify(struct axis *a, struct gon_error *err)
{
    struct profiled_axis *z = axis_of(a);
    struct axis_status s;
    char title[PROFILE_TEXT];
    int rc = session_identify(z->s, title, sizeof title, err);
    z->moved = false;
    if (rc == 0)
        rc = status(a, &s, err);
    if (rc == 0)
        rc = send_if_any(z, z->is->clear, err);
    if (rc == 0)
        rc = send_if_any(z, z->is->enable, err);
    return rc;
}

// --- commands ------------------------------------------------------------------------------------

static int move_abs(struct axis *a, int32_t position_steps, int32_t speed_steps_per_s,
                    int32_t acceleration_steps_per_s2, struct gon_error *err)
{
    struct profiled_axis *z = axis_of(a);
    if (speed_steps_per_s < z->is->speed_least || speed_steps_per_s > z->is->speed_most ||
        acceleration_steps_per_s2 < 1 || acceleration_steps_per_s2 > z->is->acceleration_most)
        return gon_fail(
            err, GON_E_INPUT,
            "unit %d: %ld steps/s, %ld steps/s2; allowed: %.0f..%.0f steps/s, 1..%.0f steps/s2",
            z->unit, (long)speed_steps_per_s, (long)acceleration_steps_per_s2, z->is->speed_least,
            z->is->speed_most, z->is->acceleration_most);
    const struct profile_param params[] = {{"position", position_steps},
                                           {"speed", speed_steps_per_s},
                                           {"acceleration", acceleration_steps_per_s2},
                                           {NULL, 0}};
    z->moved = false;
    int rc = session_send(z->s, z->is->move, params, err);
    if (rc < 0)
        return rc;
    z->moved = true;
    z->target = position_steps;
    return 0;
}

static int stop(struct axis *a, struct gon_error *err)
{
    axis_of(a)->moved = false;
    return session_send(axis_of(a)->s, axis_of(a)->is->stop, NULL, err);
}

static int home(struct axis *a, struct gon_error *err)
{
    struct profiled_axis *z = axis_of(a);
    if (!*z->is->home)
        return gon_fail(err, GON_E_DEVICE, "%s: cannot be homed from here; home it by hand",
                        session_link(z->s));
    z->moved = false;
    return session_send(z->s, z->is->home, NULL, err);
}

// A drive that had an alarm may have switched its motor off.
static int reset_alarm(struct axis *a, struct gon_error *err)
{
    struct profiled_axis *z = axis_of(a);
    if (!*z->is->reset)
        return gon_fail(err, GON_E_DEVICE,
                        "%s: its alarm cannot be reset from here; switch it off and on",
                        session_link(z->s));
    int rc = session_send(z->s, z->is->reset, NULL, err);
    return rc < 0 ? rc : send_if_any(z, z->is->enable, err);
}

static const char *alarm_text(const struct axis *a, int code)
{
    const struct profile_axis *is = ((const struct profiled_axis *)a)->is;
    for (int i = 0; i < is->alarms_count; i++)
        if (is->alarms[i].code == code)
            return is->alarms[i].text;
    return code ? "not in the list of alarms" : "no alarm";
}

static const struct link_stats *stats(const struct axis *a)
{
    return bus_stats(((const struct profiled_axis *)a)->bus);
}

static void axis_free(struct axis *a)
{
    session_free(axis_of(a)->s);
    free(a);
}

struct axis *axis_by_profile(const struct profile *p, struct bus *bus, int unit)
{
    static const struct axis_ops ops = {identify,    status,     move_abs, stop,     home,
                                        reset_alarm, alarm_text, stats,    axis_free};
    struct profiled_axis *z = calloc(1, sizeof *z);
    if (!z)
        return NULL;
    *z = (struct profiled_axis){.axis = {&ops}, .is = &p->axis, .bus = bus, .unit = unit};
    z->kept_ns = INT64_MIN / 2;
    if (!(z->s = session_on_bus(p, bus, unit))) {
        free(z);
        return NULL;
    }
    return &z->axis;
}
