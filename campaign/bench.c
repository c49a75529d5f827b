// SPDX-License-Identifier: MIT
#include "campaign/bench.h"

#include "campaign/bench_check.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const regimes[] = {"underfilled", "overfilled", NULL};
static const char *const arms[] = {"run", "explicit", NULL};
static const char *const approaches[] = {"from-below", "from-above", NULL};

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
    TEXT(bench_axis, "name", name, NULL,
         "Free; \"theta_i\" and \"theta_r\" are the angles unless kinematics says otherwise, "
         "\"sample\" moves the sample out of the beam."),
    TEXT(bench_axis, "driver", driver, NULL,
         "The controller's profile: its name (\"oriental-az\") or a path with a slash in it."),
    TEXT(bench_axis, "bus", bus, NULL, "The name of one of the buses."),
    WHOLE(bench_axis, "unit", unit, NULL, 1, 247, NULL, "The controller's address on its bus."),
    TEXT(bench_axis, "unit_name", unit_name, "\"deg\"",
         "What its positions are in: deg or mm; of the sample mm."),
    REAL(bench_axis, "steps_per_unit", steps_per_unit, NULL, -1e7, 1e7, NULL,
         "Motor steps a degree or millimetre; negative turns the direction round."),
    REAL(bench_axis, "encoder_steps", encoder_steps, NULL, 1e-6, 1e6, "1",
         "Steps that the encoder counts while the motor makes one."),
    REAL(bench_axis, "min", min, NULL, -1e4, 1e4, NULL,
         "The lowest position that is ever commanded."),
    REAL(bench_axis, "max", max, NULL, -1e4, 1e4, NULL, "The highest."),
    {.name = "sweep",
     .type = CFG_REALS,
     .offset = offsetof(struct bench_axis, sweep),
     .size = 2,
     .count_offset = offsetof(struct bench_axis, sweep_count),
     .min = -1e4,
     .max = 1e4,
     .fallback = "",
     .help = "Lowest and highest position of a sweep, within min and max, which they are if left "
             "out; stations may stand outside."},
    REAL(bench_axis, "speed", speed, NULL, 1e-3, 1e4, NULL, "Units a second."),
    REAL(bench_axis, "acceleration", acceleration, NULL, 1e-3, 1e6, NULL,
         "Units a second, each second."),
    REAL(bench_axis, "backlash", backlash, NULL, 0, 10, "0",
         "Play of the drive: positions are approached from one side by this."),
    CHOICE(bench_axis, "approach", approach, approaches, "\"from-below\"",
           "The side from which they are approached."),
    REAL(bench_axis, "deadband", deadband, NULL, 0, 10, NULL, "A position is reached within this."),
    WHOLE(bench_axis, "retries", retries, NULL, 0, 20, "2",
          "Further tries when it comes to stand outside the deadband; then the run pauses."),
    REAL(bench_axis, "following_error", following_error, NULL, 0, 1e4, "0",
         "The most that it may be off its predicted way while it moves; 0: any."),
    REAL(bench_axis, "zero", zero, NULL, -1e4, 1e4, "0",
         "The position at the controller's step 0: position = steps / steps_per_unit + zero."),
    {0}};

static const struct cfg_row laser_rows[] = {
    TEXT(bench_config, "driver", laser.driver, NULL,
         "The laser's profile: its name (\"cobolt-05\") or a path with a slash in it."),
    TEXT(bench_config, "link", laser.link, NULL,
         "\"serial:/dev/ttyUSB1?baud=115200\", \"tcp:host:port\" or \"usbtmc:vid:pid:serial\"."),
    REAL(bench_config, "power_w", laser.power_w, "W", 1e-6, 100, NULL, "The set-point."),
    REAL(bench_config, "warmup_s", laser.warmup_s, "s", 0, 14400, NULL,
         "From emission to a steady beam."),
    CHOICE(bench_config, "arm", laser.arm, arms, "\"run\"",
           "Who arms the laser: the commands that start light, in their person's name, or only "
           "gonio laser arm."),
    REAL(bench_config, "arm_h", laser.arm_h, "h", 0.0003, 168, "12",
         "For how long, where the command does not say it."),
    REAL(bench_config, "align_power_w", laser.align_power_w, "W", 0, 100, "0",
         "The most of gonio laser align; 0: not allowed."),
    CHOICE(
        bench_config, "polarisation", laser.polarisation, polarisation_names, NULL,
        "Of the light on the sample; \"unknown\" is an answer, and a warning with every result."),
    {0}};

static const struct cfg_row detector_rows[] = {
    TEXT(bench_config, "driver", detector.driver, NULL,
         "The detector's profile: its name (\"sr830\") or a path with a slash in it."),
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

static const struct cfg_row mark_rows[] = {
    TEXT(bench_mark, "name", name, NULL, "The name of one of the axes."),
    REAL(bench_mark, "at", at, NULL, -1e4, 1e4, NULL, "Where it stands, in its units."),
    {0}};

static const struct cfg_row station_rows[] = {
    TEXT(bench_station, "name", name, NULL,
         "\"beam\" is where the detector looks into the beam; others are free."),
    REAL(bench_station, "theta_i_deg", theta_i_deg, "deg", -360, 360, NULL, "Its theta_i."),
    REAL(bench_station, "theta_r_deg", theta_r_deg, "deg", -360, 360, NULL, "Its theta_r."),
    REAL(bench_station, "sample_mm", sample_mm, "mm", -1e4, 1e4, "0",
         "Where the sample stands, if that moves."),
    TEXT(bench_station, "arrive", arrive, "",
         "What a person does before the axes go there (\"take the sample out\"): a run waits, laser "
         "off, for gonio ack."),
    TEXT(bench_station, "leave", leave, "",
         "Likewise before they go elsewhere (\"put the sample in\")."),
    {.name = "axes",
     .type = CFG_GROUPS,
     .offset = offsetof(struct bench_station, marks),
     .size = BENCH_AXES,
     .stride = sizeof(struct bench_mark),
     .count_offset = offsetof(struct bench_station, marks_count),
     .fallback = "",
     .rows = mark_rows,
     .help = "Where single axes stand, before what follows from the angles."},
    {.name = "devices",
     .type = CFG_GROUPS,
     .offset = offsetof(struct bench_station, places),
     .size = BENCH_DEVICES,
     .stride = sizeof(struct bench_place),
     .count_offset = offsetof(struct bench_station, places_count),
     .fallback = "",
     .rows = bench_place_rows,
     .help = "Positions of devices there, instead of those they have otherwise; set before the "
             "axes go there, and taken back after they have left."},
    {0}};

static const struct cfg_row keep_out_rows[] = {
    TEXT(bench_keep_out, "name", name, NULL, "What is in the way."),
    {.name = "polygon",
     .type = CFG_PAIRS,
     .offset = offsetof(struct bench_keep_out, vertex),
     .size = BENCH_VERTICES,
     .count_offset = offsetof(struct bench_keep_out, vertices),
     .unit = "deg",
     .min = -360,
     .max = 360,
     .help = "Its corners ( (theta_i, theta_r), ... ), at least three; a tenth of a degree around "
             "it is kept clear too."},
    {0}};

#define COEFFICIENT(n) REAL(bench_row, #n, n, NULL, -1e3, 1e3, "0", "Its share in the position.")

static const struct cfg_row row_rows[] = {
    TEXT(bench_row, "axis", axis, NULL, "The name of one of the axes."),
    COEFFICIENT(theta_i),
    COEFFICIENT(theta_r),
    COEFFICIENT(phi),
    COEFFICIENT(polariser),
    COEFFICIENT(analyser),
    REAL(bench_row, "offset", offset, "deg", -1e4, 1e4, "0", "Added to their sum."),
    {0}};

static const struct cfg_row daemon_rows[] = {
    TEXT(bench_config, "directory", directory, "",
         "Where campaign files go; goniod(8), FILES, says what goes before it and where otherwise."),
    {.name = "notify",
     .type = CFG_STRINGS,
     .offset = offsetof(struct bench_config, notify.argv),
     .size = BENCH_NOTIFY,
     .stride = sizeof(((struct bench_config *)0)->notify.argv[0]),
     .count_offset = offsetof(struct bench_config, notify.argc),
     .fallback = "[ ]",
     .help = "A program by its path and its arguments, started without a shell when a run is paused, "
             "failed or done; the last argument is the sentence that says so."},
    REAL(bench_config, "step_limit_s", step_limit_s, "s", 0, 864000, "600",
         "A person's step that is not acknowledged so long is told once more; 0: never."),
    REAL(bench_config, "notify_limit_s", notify.limit_s, "s", 0.1, 600, "10",
         "After this time that program is killed."),
    {0}};

#define MANY(n, member, most, element, table, def, text)                                           \
    {                                                                                              \
        .name = n, .type = CFG_GROUPS, .offset = offsetof(struct bench_config, member),            \
        .size = most, .stride = sizeof(struct element),                                            \
        .count_offset = offsetof(struct bench_config, member##_count), .rows = table,              \
        .fallback = def, .help = text                                                              \
    }
#define GROUP(n, table, def, text)                                                                 \
    {                                                                                              \
        .name = n, .type = CFG_GROUP, .rows = table, .fallback = def, .help = text                 \
    }

static const struct cfg_row kinematics_rows[] = {
    CHOICE(bench_config, "kind", kinematics.kind, kinematics_kinds, "\"linear\"",
           "How angles become positions: by a matrix, or with a sample that tilts two ways."),
    {.name = "rows",
     .type = CFG_GROUPS,
     .offset = offsetof(struct bench_config, kinematics.rows),
     .size = KINEMATICS_COORDINATES,
     .stride = sizeof(struct bench_row),
     .count_offset = offsetof(struct bench_config, kinematics.rows_count),
     .fallback = "",
     .rows = row_rows,
     .help = "Of linear: an axis each, position = sum of coefficients times angles, plus offset."},
    TEXT(bench_config, "tilt", kinematics.tilt, "\"tilt\"",
         "Of spherical: the axis that tilts the sample's normal away from the beam."),
    TEXT(bench_config, "azimuth", kinematics.azimuth, "\"azimuth\"",
         "The axis that turns the tilt about the beam."),
    TEXT(bench_config, "arm", kinematics.arm, "\"arm\"",
         "The axis that turns the detector away from the source's direction."),
    TEXT(bench_config, "polariser", kinematics.polariser, "",
         "The axis of the polariser before the sample, if one turns it."),
    TEXT(bench_config, "analyser", kinematics.analyser, "",
         "The axis of the analyser on the arm, if one turns it."),
    {0}};

const struct cfg_row bench_config_schema[] = {
    GROUP("bench", bench_rows, NULL, "Geometry."),
    MANY("buses", buses, BENCH_BUSES, bench_bus, bus_rows, NULL, "What the axes are wired to."),
    MANY("axes", axes, BENCH_AXES, bench_axis, axis_rows, NULL,
         "theta_i and theta_r, or those that kinematics makes them of; sample if a motor moves it "
         "out of the beam; any others."),
    GROUP(
        "kinematics", kinematics_rows, "",
        "How the angles follow from the axes; left out, theta_i and theta_r are axes themselves."),
    MANY("keep_out", keep_out, BENCH_KEEP_OUTS, bench_keep_out, keep_out_rows, "",
         "Where the axes must not go, not even in passing."),
    GROUP("laser", laser_rows, NULL, "The laser."),
    GROUP("detector", detector_rows, NULL, "The detector chain."),
    {.name = "monitor",
     .type = CFG_GROUP,
     .offset = offsetof(struct bench_config, monitor),
     .rows = bench_monitor_rows,
     .fallback = "",
     .help = "A detector of its own as reference monitor, read directly after each sample of the "
             "detector; instead of detector.monitor_aux."},
    MANY("devices", devices, BENCH_DEVICES, bench_device, bench_device_rows, "",
         "Shutters, filter wheels, choppers and other selectors, and inputs."),
    MANY("suspenders", suspenders, BENCH_SUSPENDERS, bench_suspender, bench_suspender_rows, "",
         "Conditions under which a run pauses in the safe state."),
    {.name = "polarisation",
     .type = CFG_GROUP,
     .offset = offsetof(struct bench_config, polarisation),
     .rows = bench_polarisation_rows,
     .fallback = "",
     .help = "States of polarisation that elements on axes make; none: nothing moves for them."},
    MANY("stations", stations, BENCH_STATIONS, bench_station, station_rows, NULL,
         "Named positions; beam must be one."),
    GROUP("daemon", daemon_rows, "", "Of goniod itself."),
    {0}};

// --- reading -------------------------------------------------------------------------------------

static int take(struct cfg_file *f, struct bench_config *ret_bench, char **ret_text)
{
    struct bench_config b;
    memset(&b, 0, sizeof b);
    if (!f || cfg_take(f, bench_config_schema, &b) || bench_check(f, &b))
        return GON_E_INPUT;
    if (ret_text && !(*ret_text = strdup(cfg_text(f))))
        return GON_E_SYSTEM;
    *ret_bench = b;
    return GON_OK;
}

static void keep_folder(const char *path, char *folder)
{
    const char *slash = strrchr(path, '/');
    const size_t size = !slash ? 0 : slash == path ? 1 : (size_t)(slash - path);
    snprintf(folder, BENCH_FOLDER, "%.*s", (int)size, path);
}

int bench_config_load(const char *path, struct cfg_sink sink, struct bench_config *ret_bench,
                      char **ret_text)
{
    struct cfg_file *f = cfg_open(path, sink);
    int rc = take(f, ret_bench, ret_text);
    cfg_close(f);
    if (rc >= 0)
        keep_folder(path, ret_bench->folder);
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
