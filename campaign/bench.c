// SPDX-License-Identifier: MIT
#include "campaign/bench.h"

#include "base/options.h"
#include "base/units.h"

#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

const char *const bench_axis_drivers[] = {"oriental-az", NULL};
const char *const bench_laser_drivers[] = {"cobolt-05", NULL};
const char *const bench_detector_drivers[] = {"sr830", NULL};
static const char *const regimes[] = {"underfilled", "overfilled", NULL};
static const char *const axis_names[] = {"theta_i", "theta_r", "sample", NULL};

#define TEXT(s, n, member, def, text)                                                              \
    {                                                                                              \
        .name = n, .type = CFG_STRING, .offset = offsetof(struct s, member),                       \
        .size = sizeof((struct s *)0)->member, .fallback = def, .help = text                       \
    }
#define REAL(s, n, member, u, lo, hi, def, text)                                                   \
    {                                                                                              \
        .name = n, .type = CFG_REAL, .offset = offsetof(struct s, member), .unit = u, .min = lo,   \
        .max = hi, .fallback = def, .help = text                                                   \
    }
#define WHOLE(s, n, member, u, lo, hi, def, text)                                                  \
    {                                                                                              \
        .name = n, .type = CFG_INT, .offset = offsetof(struct s, member), .unit = u, .min = lo,    \
        .max = hi, .fallback = def, .help = text                                                   \
    }
#define CHOICE(s, n, member, list, def, text)                                                      \
    {                                                                                              \
        .name = n, .type = CFG_CHOICE, .offset = offsetof(struct s, member), .choices = list,      \
        .fallback = def, .help = text                                                              \
    }

static const struct cfg_row bench_rows[] = {
    TEXT(bench_config, "name", name, "", "What the bench is called."),
    REAL(bench_config, "wavelength_nm", wavelength_nm, "nm", 100, 30000, NULL, "Of the laser."),
    CHOICE(
        bench_config, "regime", regime, regimes, "\"underfilled\"",
        "Whether the laser spot lies inside the detector's field of view, or the other way round."),
    REAL(bench_config, "aperture_radius_mm", aperture_radius_mm, "mm", 0.001, 1000, NULL,
         "Of the detector's aperture."),
    REAL(bench_config, "u_aperture_radius_mm", u_aperture_radius_mm, "mm", 0, 100, NULL,
         "Its standard uncertainty."),
    REAL(bench_config, "distance_mm", distance_mm, "mm", 1, 100000, NULL,
         "From the sample to the aperture."),
    REAL(bench_config, "u_distance_mm", u_distance_mm, "mm", 0, 1000, NULL,
         "Its standard uncertainty."),
    {0}};

static const struct cfg_row bus_rows[] = {
    TEXT(bench_bus, "name", name, NULL, "What axes call it."),
    TEXT(bench_bus, "link", link, NULL,
         "\"modbus-rtu:/dev/ttyUSB0?baud=115200&parity=E\" or \"modbus-tcp:host:port\"."),
    WHOLE(bench_bus, "timeout_ms", timeout_ms, "ms", 10, 200, "200",
          "How long an answer may take."),
    {0}};

static const struct cfg_row axis_rows[] = {
    TEXT(bench_axis, "name", name, NULL, "\"theta_i\", \"theta_r\" or \"sample\"."),
    CHOICE(bench_axis, "driver", driver, bench_axis_drivers, NULL, "The kind of controller."),
    TEXT(bench_axis, "bus", bus, NULL, "The name of one of the buses."),
    WHOLE(bench_axis, "unit", unit, NULL, 1, 247, NULL, "The controller's address on its bus."),
    TEXT(bench_axis, "unit_name", unit_name, "\"deg\"",
         "What its positions are in: deg, for the sample mm."),
    REAL(bench_axis, "steps_per_unit", steps_per_unit, NULL, -1e7, 1e7, NULL,
         "Motor steps a degree or millimetre; negative turns the direction round."),
    REAL(bench_axis, "min", min, NULL, -1e4, 1e4, NULL,
         "The lowest position that is ever commanded."),
    REAL(bench_axis, "max", max, NULL, -1e4, 1e4, NULL, "The highest."),
    REAL(bench_axis, "speed", speed, NULL, 1e-3, 1e4, NULL, "Units a second."),
    REAL(bench_axis, "acceleration", acceleration, NULL, 1e-3, 1e6, NULL,
         "Units a second, each second."),
    REAL(bench_axis, "backlash", backlash, NULL, 0, 10, "0",
         "Play of the drive: positions are approached from below by this."),
    REAL(bench_axis, "deadband", deadband, NULL, 0, 10, NULL, "A position is reached within this."),
    REAL(bench_axis, "zero", zero, NULL, -1e4, 1e4, "0",
         "The position at the controller's step 0."),
    {0}};

static const struct cfg_row laser_rows[] = {
    CHOICE(bench_config, "driver", laser.driver, bench_laser_drivers, NULL, "The kind of laser."),
    TEXT(bench_config, "link", laser.link, NULL,
         "\"serial:/dev/ttyUSB1?baud=115200\", \"tcp:host:port\" or \"usbtmc:vid:pid:serial\"."),
    REAL(bench_config, "power_w", laser.power_w, "W", 1e-6, 100, NULL, "The set-point."),
    REAL(bench_config, "warmup_s", laser.warmup_s, "s", 0, 14400, NULL,
         "From emission to a steady beam."),
    CHOICE(
        bench_config, "polarisation", laser.polarisation, polarisation_names, NULL,
        "Of the light on the sample; \"unknown\" is an answer, and a warning with every result."),
    {0}};

static const struct cfg_row detector_rows[] = {
    CHOICE(bench_config, "driver", detector.driver, bench_detector_drivers, NULL,
           "The kind of detector."),
    TEXT(bench_config, "link", detector.link, NULL,
         "\"serial:/dev/ttyUSB2?baud=19200\", \"tcp:host:port\" or \"usbtmc:vid:pid:serial\"."),
    REAL(bench_config, "time_constant_s", detector.time_constant_s, "s", 1e-5, 300, NULL,
         "Of its filter."),
    WHOLE(bench_config, "slope_db", detector.slope_db, "dB", 6, 24, "24",
          "Of its filter, an octave: 6, 12, 18 or 24."),
    WHOLE(bench_config, "monitor_aux", detector.monitor_aux, NULL, 0, 4, "0",
          "The auxiliary input that the reference monitor is wired to; 0: no monitor."),
    REAL(bench_config, "u_linearity_rel", detector.u_linearity_rel, NULL, 0, 1, "0",
         "Standard uncertainty of the ratio of a small signal to the beam's, relative."),
    {0}};

static const struct cfg_row station_rows[] = {
    TEXT(bench_station, "name", name, NULL,
         "\"beam\" is where the detector looks into the beam; others are free."),
    REAL(bench_station, "theta_i_deg", theta_i_deg, "deg", -360, 360, NULL,
         "Where theta_i stands."),
    REAL(bench_station, "theta_r_deg", theta_r_deg, "deg", -360, 360, NULL,
         "Where theta_r stands."),
    REAL(bench_station, "sample_mm", sample_mm, "mm", -1e4, 1e4, "0",
         "Where the sample stands, if that moves."),
    {0}};

static const struct cfg_row daemon_rows[] = {
    TEXT(bench_config, "directory", directory, "",
         "Where campaign files go; goniod(8), FILES, says what goes before it and where otherwise."),
    {0}};

#define MANY(n, member, most, element, table, text)                                                \
    {                                                                                              \
        .name = n, .type = CFG_GROUPS, .offset = offsetof(struct bench_config, member),            \
        .size = most, .stride = sizeof(struct element),                                            \
        .count_offset = offsetof(struct bench_config, member##_count), .rows = table, .help = text \
    }
#define GROUP(n, table, def, text)                                                                 \
    {                                                                                              \
        .name = n, .type = CFG_GROUP, .rows = table, .fallback = def, .help = text                 \
    }

const struct cfg_row bench_config_schema[] = {
    GROUP("bench", bench_rows, NULL, "Geometry."),
    MANY("buses", buses, BENCH_BUSES, bench_bus, bus_rows, "What the axes are wired to."),
    MANY("axes", axes, BENCH_AXES, bench_axis, axis_rows,
         "theta_i and theta_r; sample if a motor moves it out of the beam."),
    GROUP("laser", laser_rows, NULL, "The laser."),
    GROUP("detector", detector_rows, NULL, "The detector chain."),
    MANY("stations", stations, BENCH_STATIONS, bench_station, station_rows,
         "Named positions; beam must be one."),
    GROUP("daemon", daemon_rows, "", "Of goniod itself."),
    {0}};

// --- checks across settings ----------------------------------------------------------------------

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

static int check_axis_name(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_axis *a = &b->axes[i];
    int known = 0, mistakes = 0;
    while (axis_names[known] && strcmp(axis_names[known], a->name))
        known++;
    if (!axis_names[known]) {
        const char *meant = options_suggest(a->name, axis_names);
        return complain(f, "axes", i, "name", "unknown; allowed theta_i, theta_r, sample%s%s%s",
                        meant ? "; did you mean '" : "", meant ? meant : "", meant ? "'?" : "");
    }
    const char *unit_name = strcmp(a->name, "sample") ? "deg" : "mm";
    if (strcmp(a->unit_name, unit_name))
        mistakes += complain(f, "axes", i, "unit_name", "%s is in %s", a->name, unit_name);
    for (int j = 0; j < i; j++)
        if (!strcmp(a->name, b->axes[j].name))
            mistakes += complain(f, "axes", i, "name", "is the name of axes[%d] too", j);
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
    if (!(a->min < a->max))
        mistakes += complain(f, "axes", i, "min", "not below max = %.9g", a->max);
    const double farthest = fmax(fabs(a->min - a->zero), fabs(a->max - a->zero));
    if (a->steps_per_unit == 0 || fabs(a->steps_per_unit) * farthest > INT_MAX)
        mistakes +=
            complain(f, "axes", i, "steps_per_unit",
                     "must not be 0, and max and min must be within 2147483647 steps of zero");
    return mistakes;
}

static int check_within(struct cfg_file *f, const struct bench_config *b, int i, const char *axis,
                        const char *member, double value)
{
    const struct bench_axis *a = bench_find_axis(b, axis);
    if (!a || (value >= a->min && value <= a->max))
        return 0;
    return complain(f, "stations", i, member, "beyond the limits of axis %s; allowed %.9g..%.9g %s",
                    axis, a->min, a->max, a->unit_name);
}

static int check_station(struct cfg_file *f, const struct bench_config *b, int i)
{
    const struct bench_station *s = &b->stations[i];
    int mistakes = 0;
    for (int j = 0; j < i; j++)
        if (!strcmp(s->name, b->stations[j].name))
            mistakes += complain(f, "stations", i, "name", "is the name of stations[%d] too", j);
    mistakes += check_within(f, b, i, "theta_i", "theta_i_deg", s->theta_i_deg);
    mistakes += check_within(f, b, i, "theta_r", "theta_r_deg", s->theta_r_deg);
    return mistakes + check_within(f, b, i, "sample", "sample_mm", s->sample_mm);
}

static int check(struct cfg_file *f, const struct bench_config *b)
{
    int mistakes = 0;
    for (int i = 0; i < b->buses_count; i++)
        mistakes += check_bus(f, b, i);
    for (int i = 0; i < b->axes_count; i++)
        mistakes += check_axis(f, b, i);
    for (int i = 0; i < b->stations_count; i++)
        mistakes += check_station(f, b, i);
    for (int i = 0; i < 2; i++)
        if (!bench_find_axis(b, axis_names[i]))
            mistakes += cfg_complain(f, "axes", "axis '%s' is missing", axis_names[i]);
    if (!bench_find_station(b, "beam"))
        mistakes += cfg_complain(
            f, "stations", "station 'beam' is missing: where the detector looks into the beam");
    mistakes += check_text_link(f, "laser.link", b->laser.link);
    mistakes += check_text_link(f, "detector.link", b->detector.link);
    if (b->detector.slope_db % 6)
        mistakes += cfg_complain(f, "detector.slope_db", "allowed 6, 12, 18, 24 dB");
    return mistakes;
}

// --- reading -------------------------------------------------------------------------------------

static int take(struct cfg_file *f, struct bench_config *ret_bench, char **ret_text)
{
    struct bench_config b;
    memset(&b, 0, sizeof b);
    if (!f || cfg_take(f, bench_config_schema, &b) || check(f, &b))
        return GON_E_INPUT;
    if (ret_text && !(*ret_text = strdup(cfg_text(f))))
        return GON_E_SYSTEM;
    *ret_bench = b;
    return GON_OK;
}

int bench_config_load(const char *path, struct cfg_sink sink, struct bench_config *ret_bench,
                      char **ret_text)
{
    struct cfg_file *f = cfg_open(path, sink);
    int rc = take(f, ret_bench, ret_text);
    cfg_close(f);
    return rc;
}

int bench_config_parse(const char *text, const char *name, struct cfg_sink sink,
                       struct bench_config *ret_bench)
{
    struct cfg_file *f = cfg_parse(text, name, sink);
    int rc = take(f, ret_bench, NULL);
    cfg_close(f);
    return rc;
}

const struct bench_axis *bench_find_axis(const struct bench_config *b, const char *name)
{
    for (int i = 0; i < b->axes_count; i++)
        if (!strcmp(b->axes[i].name, name))
            return &b->axes[i];
    return NULL;
}

const struct bench_station *bench_find_station(const struct bench_config *b, const char *name)
{
    for (int i = 0; i < b->stations_count; i++)
        if (!strcmp(b->stations[i].name, name))
            return &b->stations[i];
    return NULL;
}

double bench_omega_sr(const struct bench_config *b)
{
    return UNITS_PI * (b->aperture_radius_mm / b->distance_mm) *
           (b->aperture_radius_mm / b->distance_mm);
}
