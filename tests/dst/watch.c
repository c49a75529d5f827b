// SPDX-License-Identifier: MIT
#include "tests/dst/watch.h"

#include "base/units.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#define LEASE_NS OS_MS(500)
#define REST_NS OS_S(8) // until a laser that can be reached is off at rest: its reopening is paced
#define ALARM_NS OS_S(12) // until an axis's alarm is noticed: at the latest when the store answered
#define LOST_NS OS_S(1)   // a command that was on its way when home was lost
#define STOP_NS OS_S(1.5) // an ON that was on its way when a stop came
#define STOPPED_NS OS_S(8) // until a laser that can be reached is off after a stop
#define ASKED_NS OS_S(2)   // from the axes' answers to ON: the laser is asked many things before
#define PATH_NS OS_MS(1)

const char *const watch_rule_names[WATCH_RULES] = {"emission", "motion", "values", "rows", "words"};

void watch_init(struct watch *w, struct rig *rig, const struct bench_config *bench,
                const struct plan *plan)
{
    memset(w, 0, sizeof *w);
    w->rig = rig;
    w->bench = bench;
    w->plan = plan;
    w->breath_ns = os.now_ns;
    w->laser_hit_ns = w->forced_ns = w->world_ns = INT64_MIN / 2;
    for (int i = 0; i < RIG_AXES; i++) {
        w->motions[i] = rig->bench.world.axis[i].plan;
        w->unhomed_ns[i] = os.now_ns;
        w->alarm_ns[i] = OS_NEVER;
    }
    w->accepted = calloc((size_t)plan->count, 1);
    w->first = calloc((size_t)plan->sweeps + 2, sizeof *w->first);
    if (!w->accepted || !w->first)
        abort();
    for (int i = plan->count - 1; i >= 0; i--)
        w->first[plan->points[i].sweep] = i;
}

void watch_free(struct watch *w)
{
    free(w->row);
    free(w->accepted);
    free(w->first);
}

void watch_violate(struct watch *w, enum watch_rule rule, const char *fmt, ...)
{
    char text[WATCH_TEXT - 40];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    if (w->violations[rule]++ == 0)
        snprintf(w->texts[rule], WATCH_TEXT, "%s", text);
    os_trace("watch", '!', text, strlen(text));
    if (w->all++ == 0)
        snprintf(w->text, sizeof w->text, "%s: %s, at %.6f s", watch_rule_names[rule], text,
                 (double)os.now_ns * 1e-9);
}

void watch_stop(struct watch *w)
{
    w->stop = true;
    w->stop_ns = os.now_ns;
}

void watch_resume(struct watch *w)
{
    w->stop = w->running = false;
    w->gaps++;
    w->samples = 0;
}

static bool at_rest(enum run_state s)
{
    return s == RUN_PAUSED || s == RUN_STOPPED || s == RUN_DONE || s == RUN_FAILED ||
           s == RUN_QUEUED;
}

// --- emission ------------------------------------------------------------------------------------

static int64_t later(int64_t a, int64_t b)
{
    return a > b ? a : b;
}

static void switched_on(struct watch *w, int64_t t_ns)
{
    if (w->forced_ns == t_ns) // a fault did it
        return;
    if (!w->running || at_rest(w->state))
        watch_violate(w, WATCH_EMISSION, "switched on while the campaign is %s",
                      w->running ? run_state_name(w->state) : "not there");
    if (!w->rig->bench.world.laser.interlock_closed)
        watch_violate(w, WATCH_EMISSION, "switched on with the interlock open");
    for (int i = 0; i < RIG_AXES; i++)
        if (bench_motor(&w->rig->bench, (enum world_axis)i, t_ns).alarm &&
            t_ns > w->alarm_ns[i] + ASKED_NS)
            watch_violate(w, WATCH_EMISSION, "switched on with an alarm of %s",
                          world_axis_names[i]);
    if (w->stop && t_ns > w->stop_ns + STOP_NS) // ON was on its way: OFF follows
        watch_violate(w, WATCH_EMISSION, "switched on %.1f s after a stop",
                      (double)(t_ns - w->stop_ns) * 1e-9);
}

static void look_at_light(struct watch *w, int64_t t_ns)
{
    const bool emits = rig_emits(w->rig);
    const struct line *line = &w->rig->line[RIG_LASER];
    if (emits && !w->emits)
        switched_on(w, t_ns);
    w->emits = emits;
    if (!line_is_clean(line) || w->rig->bench.world.laser.ignores_off)
        w->laser_hit_ns = t_ns;
    w->laser_hit_ns = later(w->laser_hit_ns, line->hit_ns);
    if (!emits)
        return;
    const bool leased = w->running && w->state != RUN_STOPPED && w->state != RUN_DONE;
    if (leased && t_ns - w->breath_ns > w->worst_gap_ns)
        w->worst_gap_ns = t_ns - w->breath_ns;
    if (leased && t_ns - w->breath_ns > LEASE_NS)
        watch_violate(w, WATCH_EMISSION, "on for %.3f s without a breath",
                      (double)(t_ns - w->breath_ns) * 1e-9);
    const int64_t due_ns = later(later(w->state_ns, w->laser_hit_ns), w->forced_ns) + REST_NS;
    const bool light = sim_laser_emits(&w->rig->bench.world.laser); // not only on its way
    if (w->running && at_rest(w->state) && light && t_ns > due_ns)
        watch_violate(w, WATCH_EMISSION, "still on %.1f s after %s, and the laser can be reached",
                      (double)(t_ns - w->state_ns) * 1e-9, run_state_name(w->state));
    if (w->stop && t_ns > later(w->stop_ns, w->laser_hit_ns) + STOPPED_NS &&
        t_ns > w->forced_ns + REST_NS)
        watch_violate(w, WATCH_EMISSION, "on %.1f s after a stop",
                      (double)(t_ns - w->stop_ns) * 1e-9);
    for (int i = 0; i < RIG_AXES; i++)
        if (w->alarm_ns[i] != OS_NEVER &&
            t_ns > later(w->alarm_ns[i] + ALARM_NS, w->laser_hit_ns + REST_NS))
            watch_violate(w, WATCH_EMISSION, "on %.1f s after an alarm of %s",
                          (double)(t_ns - w->alarm_ns[i]) * 1e-9, world_axis_names[i]);
}

// --- motion --------------------------------------------------------------------------------------

static bool inside(const struct bench_keep_out *k, double x, double y)
{
    bool in = false;
    for (int i = 0, j = k->vertices - 1; i < k->vertices; j = i++) {
        const double *a = k->vertex[i], *b = k->vertex[j];
        if ((a[1] > y) != (b[1] > y) && x < (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) + a[0])
            in = !in;
    }
    return in;
}

static void check_place(struct watch *w, int64_t t_ns)
{
    const struct motion *axis = w->rig->bench.world.axis;
    const double x = motion_at(&axis[0], t_ns).load, y = motion_at(&axis[1], t_ns).load;
    for (int i = 0; i < w->bench->keep_out_count; i++)
        if (inside(&w->bench->keep_out[i], x, y))
            watch_violate(w, WATCH_MOTION, "in keep-out %s at theta_i %.2f, theta_r %.2f",
                          w->bench->keep_out[i].name, x, y);
}

// The controllers' own homing knows no keep-outs, and without home nobody knows where an axis is.
static bool all_homed(const struct watch *w)
{
    for (int i = 0; i < 2; i++)
        if (!w->is_homed[i])
            return false;
    return true;
}

static void commanded(struct watch *w, int i, int64_t t_ns)
{
    const struct motion *m = &w->rig->bench.world.axis[i];
    const struct bench *b = &w->rig->bench;
    const bool homing = b->controller == BENCH_AZ ? b->az[i].homing : b->leadshine[i].homing;
    const double left_s = motion_left_s(m, t_ns > m->start_ns ? t_ns : m->start_ns);
    const int64_t end_ns = later(t_ns, m->start_ns) + OS_S(left_s) + 1;
    const double to = motion_at(m, end_ns).motor,
                 slack = (2.0 + abs(w->rig->gate[i].miss_steps)) /
                         rig_steps_per_unit(); // a drive that misses does so by itself
    w->moving_until_ns = later(w->moving_until_ns, end_ns);
    if (w->forced_ns == t_ns || isnan(m->end) || homing) // a fault, a stop, or homing
        return;
    if (!w->is_homed[i] && t_ns > w->unhomed_ns[i] + LOST_NS)
        watch_violate(w, WATCH_MOTION, "%s moves to %.3f and is not homed", world_axis_names[i],
                      to);
    if (w->is_homed[i] &&
        (to < w->bench->axes[i].min - slack || to > w->bench->axes[i].max + slack))
        watch_violate(w, WATCH_MOTION, "%s is sent to %.3f, beyond %.1f..%.1f", world_axis_names[i],
                      to, w->bench->axes[i].min, w->bench->axes[i].max);
}

static void look_at_axes(struct watch *w, int64_t t_ns)
{
    for (int i = 0; i < RIG_AXES; i++) {
        const struct motion *m = &w->rig->bench.world.axis[i];
        const struct bench *b = &w->rig->bench;
        const bool homed = b->controller == BENCH_AZ ? b->az[i].homed : b->leadshine[i].homed;
        const int alarm = b->controller == BENCH_AZ ? b->az[i].alarm : b->leadshine[i].alarm;
        const bool homing = b->controller == BENCH_AZ ? b->az[i].homing : b->leadshine[i].homing;
        w->homings += homing && !w->is_homing[i];
        w->is_homing[i] = homing;
        if (w->is_homed[i] && !homed)
            w->unhomed_ns[i] = t_ns;
        w->is_homed[i] = homed;
        if (m->plan != w->motions[i])
            commanded(w, i, t_ns);
        w->motions[i] = m->plan;
        if (!alarm)
            w->alarm_ns[i] = OS_NEVER;
        else if (w->alarm_ns[i] == OS_NEVER)
            w->alarm_ns[i] = t_ns;
    }
    if (w->bench->keep_out_count == 0 || !all_homed(w) || w->path_ns >= w->moving_until_ns) {
        w->path_ns = t_ns;
        return;
    }
    for (; w->path_ns < t_ns; w->path_ns += PATH_NS)
        check_place(w, w->path_ns);
    check_place(w, w->path_ns = t_ns);
}

void watch_step(struct watch *w, int64_t t_ns)
{
    look_at_axes(w, t_ns);
    look_at_light(w, t_ns);
}

void watch_breath(struct watch *w)
{
    w->breath_ns = os.now_ns;
}

// --- words ---------------------------------------------------------------------------------------

void watch_event(struct watch *w, const struct engine_event *event)
{
    if (event->kind != ENGINE_STATE)
        return;
    const char *text = event->text ? event->text : "";
    w->gaps += event->state == RUN_PAUSED;
    if (event->state == RUN_PAUSED && !*text)
        watch_violate(w, WATCH_WORDS, "paused without a reason");
    const bool known = os.now_ns > w->forced_ns + REST_NS; // not of what came by itself just now
    if (known && strstr(text, "laser off") && rig_emits(w->rig))
        watch_violate(w, WATCH_WORDS, "\"%.100s\" with the light on", text);
    if (at_rest(event->state) && event->light == SAFETY_LIGHT_OFF && rig_emits(w->rig) && known)
        watch_violate(w, WATCH_WORDS, "says the light is off in \"%.100s\"", text);
    if (at_rest(event->state) && rig_emits(w->rig) && !strstr(text, "LASER MAY BE ON") && known)
        watch_violate(w, WATCH_WORDS, "does not warn of the light: \"%.100s\"", text);
    w->running = true;
    w->state = event->state;
    w->state_ns = os.now_ns;
}

void watch_end(struct watch *w, enum run_state ended)
{
    if (ended != RUN_DONE && ended != RUN_STOPPED && ended != RUN_FAILED)
        watch_violate(w, WATCH_WORDS, "ended as %s", run_state_name(ended));
    if (ended == RUN_FAILED)
        watch_violate(w, WATCH_WORDS, "the campaign failed");
    if (ended != RUN_DONE)
        return;
    for (int i = 0; i < w->plan->count; i++)
        if (w->accepted[i] < 1 || (w->plan->points[i].sweep > 0 && w->accepted[i] > 1))
            watch_violate(w, WATCH_ROWS, "sweep %d, point %d has %d accepted readings",
                          w->plan->points[i].sweep, w->plan->points[i].point, w->accepted[i]);
}
