// SPDX-License-Identifier: MIT
#include "sim/config.h"
#include "base/options.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Offsets are all from the start of struct sim_config: groups lie at 0.
#define AT(member) offsetof(struct sim_config, member)
#define REAL(n, where, u, lo, hi, def, text)                                                       \
    {                                                                                              \
        .name = n, .type = CFG_REAL, .offset = AT(where), .unit = u, .min = lo, .max = hi,         \
        .fallback = def, .help = text                                                              \
    }
#define INT(n, where, u, lo, hi, def, text)                                                        \
    {                                                                                              \
        .name = n, .type = CFG_INT, .offset = AT(where), .unit = u, .min = lo, .max = hi,          \
        .fallback = def, .help = text                                                              \
    }
#define BOOL(n, where, def, text)                                                                  \
    {                                                                                              \
        .name = n, .type = CFG_BOOL, .offset = AT(where), .fallback = def, .help = text            \
    }
#define GROUP(n, table, text)                                                                      \
    {                                                                                              \
        .name = n, .type = CFG_GROUP, .fallback = "", .help = text, .rows = table                  \
    }

#define PROFILE(where, text)                                                                       \
    {                                                                                              \
        .name = "profile", .type = CFG_STRING, .offset = AT(where),                                \
        .size = sizeof(((struct sim_config *)0)->where), .fallback = "\"\"", .help = text          \
    }

static const char *const diffuse_names[] = {"paper", "lambert", NULL}; // enum brdf_diffuse

static const struct cfg_row sample_rows[] = {
    REAL("n", bench.world.optics.sample.n, NULL, 0.05, 20, "1.5", "refractive index of the sample"),
    REAL("k", bench.world.optics.sample.k, NULL, 0, 20, "0.02", "extinction coefficient"),
    REAL("sigma", bench.world.optics.sample.sigma, NULL, 0.001, 1, "0.15", "rms slope per axis"),
    REAL("ks", bench.world.optics.sample.ks, NULL, 0, 2, "0.9", "specular strength"),
    REAL("kd", bench.world.optics.sample.kd, NULL, 0, 2, "0.05", "diffuse strength"),
    {.name = "diffuse",
     .type = CFG_CHOICE,
     .offset = AT(bench.world.optics.diffuse),
     .fallback = "\"paper\"",
     .help = "form of the diffuse term: kd/cos theta_i, or kd/pi",
     .choices = diffuse_names},
    {0}};

static const struct cfg_row optics_rows[] = {
    REAL("aperture_radius_mm", bench.world.optics.aperture_radius_mm, "mm", 0.1, 50, "8",
         "of the detector"),
    REAL("distance_mm", bench.world.optics.distance_mm, "mm", 50, 5000, "500",
         "from the sample to the aperture"),
    REAL("divergence_deg", bench.world.optics.divergence_deg, "deg", 0.001, 0.5, "0.05",
         "half angle of the beam"),
    REAL("transmission", bench.world.optics.transmission, NULL, 0, 1, "1",
         "of the straight-through path"),
    {0}};

// enum brdf_state
static const char *const state_names[] = {"u", "s", "p", "+45", "-45", "R", "L", NULL};

static const struct cfg_row polarisation_rows[] = {
    BOOL("elements", bench.world.elements.present, "false",
         "a polariser and an analyser on axes, units 4 and 5"),
    REAL("polariser_transmission", bench.world.elements.polariser.transmission, NULL, 0.01, 1,
         "0.9", "of light along its axis"),
    REAL("polariser_extinction", bench.world.elements.polariser.extinction, NULL, 0, 0.5, "1e-5",
         "crossed light that passes, over parallel"),
    REAL("analyser_transmission", bench.world.elements.analyser.transmission, NULL, 0.01, 1, "0.9",
         "of light along its axis"),
    REAL("analyser_extinction", bench.world.elements.analyser.extinction, NULL, 0, 0.5, "1e-5",
         "crossed light that passes, over parallel"),
    {0}};

static const struct cfg_row axes_rows[] = {
    {.name = "controller",
     .type = CFG_CHOICE,
     .offset = AT(bench.controller),
     .fallback = "\"oriental-az\"",
     .help = "what drives the axes; also written into the bench files for goniod",
     .choices = bench_controllers},
    PROFILE(axes_profile, "made from this profile instead, a name or a file"),
    REAL("speed", speed, "deg/s", 0.01, 2000, "20", "written into the bench files for goniod"),
    REAL("acceleration", acceleration, "deg/s2", 0.1, 1e6, "60",
         "written into the bench files for goniod"),
    REAL("home_speed", bench.home_speed, "deg/s", 0.01, 2000, "10", "of the controllers' homing"),
    REAL("home_acceleration", bench.home_acceleration, "deg/s2", 0.1, 1e6, "60",
         "of the controllers' homing"),
    REAL("steps_per_unit", steps_per_unit, NULL, 1, 1e6, "1000",
         "steps of the motor per degree, or per mm"),
    REAL("backlash", backlash, "deg", 0, 1, "0.015", "of the axes that turn"),
    REAL("start_s", bench.start_s, "s", 0, 0.1, "0.002", "from a command to the motor"),
    BOOL("homed", bench.homed, "false", "home is known at power-up"),
    REAL("reply_s", bench.axes_reply_s, "s", 0, 0.2, "0", "the controllers' time to answer"),
    {0}};

static const struct cfg_row laser_rows[] = {
    PROFILE(laser_profile, "made from this profile instead of a Cobolt 05, a name or a file"),
    REAL("power_w", power_w, "W", 0.001, 10, "0.05", "written into the bench files for goniod"),
    REAL("power_max_w", bench.world.laser.power_max_w, "W", 0.001, 10, "0.1",
         "most that the laser accepts"),
    {.name = "polarisation",
     .type = CFG_CHOICE,
     .offset = AT(bench.world.elements.laser),
     .fallback = "\"u\"",
     .help = "state of its light",
     .choices = state_names},
    REAL("temperatures_s", bench.world.laser.temperatures_s, "s", 0, 600, "20",
         "until its temperatures are right"),
    REAL("warmup_s", bench.world.laser.warmup_s, "s", 0.01, 3600, "240",
         "from cold to within 0.03 % of its power"),
    REAL("drift_rms", bench.world.laser.drift_rms, NULL, 0, 0.5, "0.002", "relative slow drift"),
    REAL("drift_tau_s", bench.world.laser.drift_tau_s, "s", 1, 1e6, "1800", "its correlation time"),
    REAL("rin_rms", bench.world.laser.rin_rms, NULL, 0, 0.1, "0.0001", "relative intensity noise"),
    REAL("rin_tau_s", bench.world.laser.rin_tau_s, "s", 1e-6, 10, "0.005", "its correlation time"),
    BOOL("key_after_off", bench.world.laser.key_after_off, "false",
         "the key must be cycled after each off"),
    REAL("reply_s", bench.laser_reply_s, "s", 0, 1, "0.002", "its time to answer"),
    BOOL("echo", bench.laser_echo, "false", "it repeats each command before its answer"),
    {0}};

static const struct cfg_row detector_rows[] = {
    PROFILE(detector_profile, "made from this profile instead of an SR830, a name or a file"),
    REAL("signal_per_v", bench.signal_per_v, NULL, 0, 1e12, "0",
         "of a profile's detector, in its unit: what stands for 1 V; 0: its largest range"),
    REAL("time_constant_s", time_constant_s, "s", 1e-5, 100, "0.1",
         "written into the bench files for goniod"),
    INT("slope_db", slope_db, "dB", 6, 24, "12",
        "written into the bench files for goniod: 6, 12, 18, 24"),
    REAL("responsivity_v_per_w", bench.world.responsivity_v_per_w, "V/W", 1e-3, 1e9, "16",
         "of the signal detector"),
    REAL("offset_v", bench.world.offset_v, "V", -0.1, 0.1, "2e-7", "dark signal"),
    REAL("noise_v_per_rthz", bench.world.noise_v_per_rthz, "V/sqrt(Hz)", 0, 1e-3, "4e-9",
         "white input noise"),
    REAL("monitor_v_per_w", bench.world.monitor_v_per_w, "V/W", 0, 1e6, "40",
         "of the monitor on Aux In 1"),
    REAL("monitor_dark_v", bench.world.monitor_dark_v, "V", -1, 1, "0.002",
         "the monitor's dark signal"),
    REAL("monitor_noise_v", bench.world.monitor_noise_v, "V", 0, 1, "0.0002",
         "rms of one monitor reading"),
    REAL("reference_hz", bench.world.reference_hz, "Hz", 0.001, 102000, "1000", "of the chopper"),
    REAL("reply_s", bench.detector_reply_s, "s", 0, 1, "0.005", "its time to answer"),
    {0}};

static const struct cfg_row wires_rows[] = {
    BOOL("speed", wire_speed, "true", "serial lines take the time that their baud needs"),
    INT("axes_baud", axes_baud, "baud", 1200, 921600, "115200", "written into goniod.cfg, 8E1"),
    INT("laser_baud", laser_baud, "baud", 1200, 921600, "115200", "written into goniod.cfg"),
    INT("detector_baud", detector_baud, "baud", 1200, 921600, "19200", "written into goniod.cfg"),
    {0}};

const struct cfg_row sim_config_schema[] = {
    INT("seed", seed, NULL, 0, 2147483647, "1", "of everything random"),
    GROUP("sample", sample_rows, "the sample that the bench measures"),
    GROUP("optics", optics_rows, "geometry between laser, sample and detector"),
    GROUP("polarisation", polarisation_rows, "elements of polarisation"),
    GROUP("axes", axes_rows, "motors and their controllers"),
    GROUP("laser", laser_rows, "the laser"),
    GROUP("detector", detector_rows, "lock-in amplifier, detector and monitor"),
    GROUP("wires", wires_rows, "how the wires behave"),
    {0}};

// --- one setting ---------------------------------------------------------------------------------

static int wrong(const char *path, const char *value, const char *allowed, struct gon_error *err)
{
    return gon_fail(err, GON_E_INPUT, "%s = %s: allowed %s", path, value, allowed);
}

static int set_number(const struct cfg_row *row, const char *path, const char *value, char *target,
                      struct gon_error *err)
{
    double v;
    char allowed[80];
    bool whole = row->type == CFG_INT;
    int digits = whole ? 17 : 9;
    snprintf(allowed, sizeof allowed, "%s%.*g..%.*g%s%s", whole ? "whole numbers " : "", digits,
             row->min, digits, row->max, row->unit ? " " : "", row->unit ? row->unit : "");
    if (options_real(value, &v) || !(v >= row->min && v <= row->max))
        return wrong(path, value, allowed, err);
    if (row->type == CFG_REAL)
        *(double *)(target + row->offset) = v;
    else if (v == (int)v)
        *(int *)(target + row->offset) = (int)v;
    else
        return wrong(path, value, allowed, err);
    return 0;
}

static int set_choice(const struct cfg_row *row, const char *path, const char *value, char *target,
                      struct gon_error *err)
{
    char allowed[120] = "";
    size_t n = strlen(value);
    if (n >= 2 && value[0] == '"' && value[n - 1] == '"') {
        value++;
        n -= 2;
    }
    for (int i = 0; row->choices[i]; i++) {
        if (strlen(row->choices[i]) == n && !strncmp(value, row->choices[i], n)) {
            *(int *)(target + row->offset) = i;
            return 0;
        }
        size_t used = strlen(allowed);
        snprintf(allowed + used, sizeof allowed - used, "%s%s", i ? ", " : "", row->choices[i]);
    }
    return wrong(path, value, allowed, err);
}

static int set_text(const struct cfg_row *row, const char *path, const char *value, char *target,
                    struct gon_error *err)
{
    size_t n = strlen(value);
    if (n >= 2 && value[0] == '"' && value[n - 1] == '"') {
        value++;
        n -= 2;
    }
    if (n >= row->size)
        return gon_fail(err, GON_E_INPUT, "%s: longer than %zu characters", path, row->size - 1);
    snprintf(target + row->offset, row->size, "%.*s", (int)n, value);
    return 0;
}

static int set_one(const struct cfg_row *row, const char *path, const char *value, char *target,
                   struct gon_error *err)
{
    switch (row->type) {
    case CFG_REAL:
    case CFG_INT: return set_number(row, path, value, target, err);
    case CFG_STRING: return set_text(row, path, value, target, err);
    case CFG_CHOICE: return set_choice(row, path, value, target, err);
    case CFG_BOOL:
        if (strcmp(value, "true") && strcmp(value, "false"))
            return wrong(path, value, "true, false", err);
        *(bool *)(target + row->offset) = *value == 't';
        return 0;
    default: return gon_fail(err, GON_E_INPUT, "%s is a group; name one of its settings", path);
    }
}

// The row that a word of a path names, which ends at a dot or at its end.
static const struct cfg_row *find(const struct cfg_row *rows, const char *word, size_t size)
{
    for (; rows->name; rows++)
        if (strlen(rows->name) == size && !strncmp(rows->name, word, size))
            return rows;
    return NULL;
}

static int unknown(const struct cfg_row *rows, const char *path, const char *word,
                   struct gon_error *err)
{
    const char *names[40];
    int n = 0;
    for (; rows->name && n < 39; rows++)
        names[n++] = rows->name;
    names[n] = NULL;
    const char *meant = options_suggest(word, names);
    return gon_fail(err, GON_E_INPUT, "unknown setting '%s'%s%s%s", path,
                    meant ? "; did you mean '" : "", meant ? meant : "",
                    meant ? "'?" : "; see configs/sim.cfg");
}

#define SLOPES "6, 12, 18, 24 dB"

static bool slope_exists(const struct sim_config *c)
{
    return c->slope_db % 6 == 0;
}

int sim_config_set(struct sim_config *c, const char *name, const char *value, struct gon_error *err)
{
    const struct cfg_row *rows = sim_config_schema;
    const char *word = name;
    struct sim_config whole = *c;
    for (;;) {
        size_t size = strcspn(word, ".");
        const struct cfg_row *row = find(rows, word, size);
        if (!row)
            return unknown(rows, name, word, err);
        if (word[size] == 0) {
            int rc = set_one(row, name, value, (char *)&whole, err);
            if (rc == 0 && !slope_exists(&whole))
                rc = wrong(name, value, SLOPES, err);
            if (rc == 0)
                *c = whole;
            return rc;
        }
        if (!row->rows)
            return unknown(rows, name, word, err);
        rows = row->rows;
        word += size + 1;
    }
}

static int take_fallbacks(const struct cfg_row *rows, char *target, struct gon_error *err)
{
    int rc = 0;
    for (; rows->name && rc == 0; rows++)
        rc = rows->rows ? take_fallbacks(rows->rows, target, err)
                        : set_one(rows, rows->name, rows->fallback, target, err);
    return rc;
}

int sim_config_defaults(struct sim_config *ret_config, struct gon_error *err)
{
    struct sim_config c = {.seed = 0};
    bench_defaults(&c.bench); // what the table does not reach: limits, where things stand
    int rc = take_fallbacks(sim_config_schema, (char *)&c, err);
    if (rc == 0)
        *ret_config = c;
    return rc;
}

// A file's path that begins at the folder of the file that names it.
static void beside(const char *path, const char *was, char *name)
{
    char whole[2 * SIM_CONFIG_PATH];
    const char *slash = strrchr(path, '/');
    if (!strchr(name, '/') || *name == '/' || !slash || strcmp(was, name) == 0)
        return;
    snprintf(whole, sizeof whole, "%.*s/%s", (int)(slash - path), path, name);
    if (strlen(whole) < SIM_CONFIG_PATH)
        strcpy(name, whole);
}

int sim_config_file(struct sim_config *c, const char *path, struct cfg_sink sink)
{
    struct sim_config whole = *c;
    struct cfg_file *f = cfg_open(path, sink);
    if (!f)
        return GON_E_INPUT;
    int mistakes = cfg_take(f, sim_config_schema, &whole);
    if (mistakes == 0 && !slope_exists(&whole))
        mistakes = cfg_complain(f, "detector.slope_db", "allowed " SLOPES);
    cfg_close(f);
    if (mistakes)
        return GON_E_INPUT;
    beside(path, c->axes_profile, whole.axes_profile);
    beside(path, c->laser_profile, whole.laser_profile);
    beside(path, c->detector_profile, whole.detector_profile);
    *c = whole;
    return 0;
}

void sim_config_fast(struct sim_config *c)
{
    c->speed = c->bench.home_speed = 300;
    c->acceleration = c->bench.home_acceleration = 60000;
    c->bench.start_s = 0;
    c->bench.world.laser.temperatures_s = 0.1;
    c->bench.world.laser.warmup_s = 0.9;
    c->bench.laser_reply_s = c->bench.detector_reply_s = c->bench.axes_reply_s = 0;
    c->time_constant_s = 0.001;
    c->wire_speed = false;
}

void sim_config_finish(struct sim_config *c)
{
    c->bench.world.seed = (uint64_t)c->seed;
    for (int i = 0; i < WORLD_AXES; i++)
        c->bench.steps_per_unit[i] = c->steps_per_unit;
    for (int i = 0; i < WORLD_AXES; i++)
        if (i != WORLD_SAMPLE)
            c->bench.world.axis[i].backlash = c->backlash;
}
