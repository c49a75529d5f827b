// SPDX-License-Identifier: MIT
#include "campaign/bench_check.h"

#include "base/options.h"
#include "campaign/keepout.h"

#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static int complain(struct cfg_file *f, const char *list, int index, const char *member,
                    const char *fmt, ...) __attribute__((format(printf, 5, 6)));

static int complain(struct cfg_file *f, const char *list, int index, const char *member,
                    const char *fmt, ...)
{
    char path[80], text[300];
    va_list args;
    snprintf(path, sizeof path, "%s[%d].%s", list, index, member);
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    return cfg_complain(f, path, "%s", text);
}

static bool begins(const char *text, const char *a, const char *b)
{
    return !strncmp(text, a, strlen(a)) || !strncmp(text, b, strlen(b));
}

static int check_text_link(struct cfg_file *f, const char *path, const char *link)
{
    if (begins(link, "serial:", "tcp:") || begins(link, "usbtmc:", "usbtmc:"))
        return 0;
    return cfg_complain(f, path, "allowed serial:PORT, tcp:HOST:PORT or usbtmc:VID:PID:SERIAL");
}

static int check_bus(struct cfg_file *f, const struct bench_config *b, int i)
{
    int mistakes = 0;
    if (!begins(b->buses[i].link, "modbus-rtu:", "modbus-tcp:"))
        mistakes +=
            complain(f, "buses", i, "link", "allowed modbus-rtu:PORT or modbus-tcp:HOST:PORT");
    for (int j = 0; j < i; j++)
        if (!strcmp(b->buses[i].name, b->buses[j].name))
            mistakes += complain(f, "buses", i, "name", "is the name of buses[%d] too", j);
    return mistakes;
}

// --- axes ----------------------------------------------------------------------------------------

// Parts of the instrument share one list of names with the axes.
static int check_axis_name(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_axis *a = &b->axes[i];
    const bool is_sample = !strcmp(a->name, "sample");
    int mistakes = 0;
    if (!*a->name || a->name[strspn(a->name, "abcdefghijklmnopqrstuvwxyz0123456789_-")] ||
        !strcmp(a->name, "laser") || !strcmp(a->name, "detector") || !strcmp(a->name, "monitor"))
        mistakes += complain(f, "axes", i, "name",
                             "allowed a-z, 0-9, _ and -, and not laser, detector or monitor");
    if (is_sample ? strcmp(a->unit_name, "mm")
                  : begins(a->name, "theta_", "theta_") && strcmp(a->unit_name, "deg"))
        mistakes +=
            complain(f, "axes", i, "unit_name", "%s is in %s", a->name, is_sample ? "mm" : "deg");
    for (int j = 0; j < i; j++)
        if (!strcmp(a->name, b->axes[j].name))
            mistakes += complain(f, "axes", i, "name", "is the name of axes[%d] too", j);
    return mistakes;
}

static int check_axis_limits(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_axis *a = &b->axes[i];
    int mistakes = 0;
    if (!(a->min < a->max))
        mistakes += complain(f, "axes", i, "min", "not below max = %.9g", a->max);
    const double farthest = fmax(fabs(a->min - a->zero), fabs(a->max - a->zero));
    const double steps = fabs(a->steps_per_unit) * fmax(a->encoder_steps, 1);
    if (a->steps_per_unit == 0 || steps * farthest > INT_MAX)
        mistakes +=
            complain(f, "axes", i, "steps_per_unit",
                     "must not be 0, and max and min must be within 2147483647 steps of zero");
    if (a->sweep_count == 1)
        mistakes += complain(f, "axes", i, "sweep", "one number; write (lowest, highest)");
    if (a->sweep_count == 2 && !(a->sweep[0] < a->sweep[1]))
        mistakes += complain(f, "axes", i, "sweep", "the lowest first");
    if (a->sweep_count == 2 && !(a->sweep[0] >= a->min && a->sweep[1] <= a->max))
        mistakes +=
            complain(f, "axes", i, "sweep", "beyond the axis's travel; allowed %.9g..%.9g %s",
                     a->min, a->max, a->unit_name);
    return mistakes;
}

static int check_axis(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_axis *a = &b->axes[i];
    int mistakes = check_axis_name(f, b, i), bus = 0;
    while (bus < b->buses_count && strcmp(b->buses[bus].name, a->bus))
        bus++;
    if (bus == b->buses_count)
        mistakes += complain(f, "axes", i, "bus", "no bus of that name in buses");
    for (int j = 0; j < i; j++)
        if (!strcmp(a->bus, b->axes[j].bus) && a->unit == b->axes[j].unit)
            mistakes +=
                complain(f, "axes", i, "unit", "is the unit of axes[%d] on that bus too", j);
    return mistakes + check_axis_limits(f, b, i);
}

// The name among those of the axes that may have been meant, as a question; or "".
static const char *meant(const struct bench_config *b, const char *name, char *text, size_t size)
{
    const char *names[BENCH_AXES + 1] = {NULL};
    for (int i = 0; i < b->axes_count; i++)
        names[i] = b->axes[i].name;
    const char *near = options_suggest(name, names);
    snprintf(text, size, near ? "; did you mean '%s'?" : "%s", near ? near : "");
    return text;
}

// --- kinematics ----------------------------------------------------------------------------------

static int check_axis_of(struct cfg_file *f, const struct bench_config *b, const char *path,
                         const char *name)
{
    char hint[64];
    const struct bench_axis *a = bench_find_axis(b, name);
    if (!a)
        return cfg_complain(f, path, "no axis '%s' in axes%s", name,
                            meant(b, name, hint, sizeof hint));
    return strcmp(a->unit_name, "deg")
               ? cfg_complain(f, path, "axis %s is in %s, not deg", name, a->unit_name)
               : 0;
}

static int check_rows(struct cfg_file *f, const struct bench_config *b)
{
    const struct bench_kinematics *k = &b->kinematics;
    int mistakes = 0;
    for (int i = 0; i < k->rows_count; i++) {
        char path[40];
        snprintf(path, sizeof path, "kinematics.rows[%d].axis", i);
        mistakes += check_axis_of(f, b, path, k->rows[i].axis);
        for (int j = 0; j < i; j++)
            if (!strcmp(k->rows[i].axis, k->rows[j].axis))
                mistakes += cfg_complain(f, path, "has its row already, rows[%d]", j);
    }
    return mistakes;
}

static int check_roles(struct cfg_file *f, const struct bench_config *b)
{
    static const char *const path[] = {"kinematics.tilt", "kinematics.azimuth", "kinematics.arm",
                                       "kinematics.polariser", "kinematics.analyser"};
    const struct bench_kinematics *k = &b->kinematics;
    const char *const name[] = {k->tilt, k->azimuth, k->arm, k->polariser, k->analyser};
    int mistakes =
        k->rows_count ? cfg_complain(f, "kinematics.rows", "only kind = \"linear\" has rows") : 0;
    for (int i = 0; i < KINEMATICS_ROLES; i++) {
        if (i >= 3 && !*name[i])
            continue;
        mistakes += check_axis_of(f, b, path[i], name[i]);
        for (int j = 0; j < i; j++)
            if (!strcmp(name[i], name[j]))
                mistakes += cfg_complain(f, path[i], "is %s already", strchr(path[j], '.') + 1);
    }
    return mistakes;
}

static int check_angle_axes(struct cfg_file *f, const struct bench_config *b)
{
    int mistakes = 0;
    for (int i = 0; i < 2; i++) {
        const char *name = kinematics_coordinates[i];
        if (!bench_find_axis(b, name))
            mistakes += cfg_complain(
                f, "axes", "axis '%s' is missing, and no kinematics says what makes it", name);
    }
    return mistakes;
}

static int check_kinematics(struct cfg_file *f, const struct bench_config *b,
                            struct kinematics *ret_kinematics)
{
    struct gon_error err;
    int mistakes = b->kinematics.kind == KINEMATICS_SPHERICAL ? check_roles(f, b)
                   : b->kinematics.rows_count                 ? check_rows(f, b)
                                                              : check_angle_axes(f, b);
    if (!mistakes && bench_kinematics(b, ret_kinematics, &err) < 0)
        mistakes = cfg_complain(f, "kinematics.rows", "%s", err.text);
    return mistakes;
}

// --- keep-outs -----------------------------------------------------------------------------------

static int check_keep_out(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_keep_out *k = &b->keep_out[i];
    double area = 0;
    for (int v = 0, w = k->vertices - 1; v < k->vertices; w = v++)
        area += k->vertex[w][0] * k->vertex[v][1] - k->vertex[v][0] * k->vertex[w][1];
    if (k->vertices < 3)
        return complain(f, "keep_out", i, "polygon", "fewer than three corners");
    return area == 0 ? complain(f, "keep_out", i, "polygon", "its corners lie on one line") : 0;
}

// --- stations ------------------------------------------------------------------------------------

static int check_marks(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_station *s = &b->stations[i];
    int mistakes = 0;
    for (int m = 0; m < s->marks_count; m++) {
        char member[40], hint[64];
        const struct bench_axis *a = bench_find_axis(b, s->marks[m].name);
        snprintf(member, sizeof member, "axes[%d].%s", m, a ? "at" : "name");
        if (!a)
            mistakes += complain(f, "stations", i, member, "no axis of that name in axes%s",
                                 meant(b, s->marks[m].name, hint, sizeof hint));
    }
    return mistakes;
}

// The setting that a position at a station comes from.
static const char *source_of(const struct bench_config *b, const struct bench_station *s, int axis,
                             char *text, size_t size)
{
    const char *name = b->axes[axis].name;
    const bool direct = !b->kinematics.rows_count && b->kinematics.kind == KINEMATICS_LINEAR;
    for (int m = 0; m < s->marks_count; m++)
        if (!strcmp(s->marks[m].name, name)) {
            snprintf(text, size, "axes[%d].at", m);
            return text;
        }
    if (!strcmp(name, "sample"))
        return "sample_mm";
    snprintf(text, size, "%s_deg", name);
    return direct ? text : "name";
}

static int check_station_limits(struct cfg_file *f, const struct bench_config *b, int i,
                                const double at[BENCH_AXES])
{
    int mistakes = 0;
    for (int axis = 0; axis < b->axes_count; axis++) {
        const struct bench_axis *a = &b->axes[axis];
        char member[40], stands[40] = "";
        if (isnan(at[axis]) || (at[axis] >= a->min && at[axis] <= a->max))
            continue;
        const char *source = source_of(b, &b->stations[i], axis, member, sizeof member);
        if (!strcmp(source, "name"))
            snprintf(stands, sizeof stands, ", at %.9g", at[axis]);
        mistakes += complain(f, "stations", i, source,
                             "beyond the limits of axis %s%s; allowed %.9g..%.9g %s", a->name,
                             stands, a->min, a->max, a->unit_name);
    }
    return mistakes;
}

static int check_station_name(struct cfg_file *f, const struct bench_config *b, int i)
{
    int mistakes = 0;
    for (int j = 0; j < i; j++)
        if (!strcmp(b->stations[i].name, b->stations[j].name))
            mistakes += complain(f, "stations", i, "name", "is the name of stations[%d] too", j);
    return mistakes;
}

static int check_station(struct cfg_file *f, const struct bench_config *b,
                         const struct kinematics *k, int i)
{
    const struct bench_station *s = &b->stations[i];
    double at[BENCH_AXES];
    struct gon_error err;
    if (bench_station_at(b, k, s, at, &err) < 0)
        return complain(f, "stations", i, "name",
                        "%s; or give every axis of the kinematics in axes", err.text);
    const struct kinematics_pose pose = kinematics_forward(k, at);
    const int hit = keepout_at(b, pose.theta_i, pose.theta_r);
    int mistakes = check_station_limits(f, b, i, at);
    if (hit >= 0)
        mistakes += complain(f, "stations", i, "name", "lies in keep_out[%d] \"%s\"", hit,
                             b->keep_out[hit].name);
    return mistakes;
}

// --- all of it -----------------------------------------------------------------------------------

static int check_links(struct cfg_file *f, const struct bench_config *b)
{
    int mistakes = 0;
    mistakes += check_text_link(f, "laser.link", b->laser.link);
    mistakes += check_text_link(f, "detector.link", b->detector.link);
    if (b->detector.slope_db % 6)
        mistakes += cfg_complain(f, "detector.slope_db", "allowed 6, 12, 18, 24 dB");
    return mistakes;
}

// Not by PATH: what is started must not depend on who started goniod.
static int check_notify(struct cfg_file *f, const struct bench_config *b)
{
    if (!b->notify.argc || b->notify.argv[0][0] == '/')
        return 0;
    return cfg_complain(f, "daemon.notify", "'%s': allowed a program's full path, as /usr/bin/logger",
                        b->notify.argv[0]);
}

int bench_check(struct cfg_file *f, const struct bench_config *b)
{
    struct kinematics kinematics;
    int mistakes = 0, marks = 0, outlines = 0;
    for (int i = 0; i < b->buses_count; i++)
        mistakes += check_bus(f, b, i);
    for (int i = 0; i < b->axes_count; i++)
        mistakes += check_axis(f, b, i);
    for (int i = 0; i < b->keep_out_count; i++)
        outlines += check_keep_out(f, b, i);
    for (int i = 0; i < b->stations_count; i++)
        marks += check_station_name(f, b, i) + check_marks(f, b, i);
    const int maps = check_kinematics(f, b, &kinematics);
    for (int i = 0; i < b->stations_count && !maps && !marks && !outlines; i++)
        mistakes += check_station(f, b, &kinematics, i);
    if (!bench_find_station(b, "beam"))
        mistakes += cfg_complain(
            f, "stations", "station 'beam' is missing: where the detector looks into the beam");
    return mistakes + marks + outlines + maps + check_links(f, b) + check_notify(f, b) +
           bench_devices_check(f, b) + bench_states_check(f, b) + bench_suspend_check(f, b);
}
