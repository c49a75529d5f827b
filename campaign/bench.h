// SPDX-License-Identifier: MIT
// The bench file goniod.cfg: the instrument as data. Plain data, no drivers; man goniod.cfg(5) is
// printed from its table. Thread: any.
#pragma once
#include "base/cfg.h"
#include "base/err.h"
#include "campaign/bench_devices.h"
#include "campaign/bench_states.h"
#include "campaign/bench_suspend.h"
#include "campaign/kinematics.h"
#include "campaign/polarisation.h"

#include <stdbool.h>

enum {
    BENCH_BUSES = 4,
    BENCH_AXES = KINEMATICS_AXES,
    BENCH_STATIONS = 16,
    BENCH_KEEP_OUTS = 8,
    BENCH_VERTICES = 16,
    BENCH_NAME = 32,
    BENCH_LINK = 256,
    BENCH_FOLDER = 256,
    BENCH_NOTIFY = 12,
    BENCH_STEP = 160
};

enum bench_regime {
    BENCH_UNDERFILLED, // the laser spot lies inside the detector's field of view
    BENCH_OVERFILLED   // the field of view lies inside the spot
};

struct bench_bus {
    char name[BENCH_NAME];
    char link[BENCH_LINK]; // "modbus-rtu:/dev/ttyUSB0?baud=115200&parity=E" or
                           // "modbus-tcp:host:port"
    int timeout_ms;
};

enum bench_approach { BENCH_FROM_BELOW, BENCH_FROM_ABOVE };

// Three scales of one axis. raw: the controller's motor steps. dial: raw / |steps_per_unit|, what a
// scale fixed to the motor would show. user: sign(steps_per_unit) dial + zero, in which everything
// else is given and shown. An encoder that counts otherwise than the motor has encoder_steps of its
// own steps for one of the motor's.
struct bench_axis {
    char name[BENCH_NAME];   // free: "theta_i", "arm", "polariser"; "sample" goes out of the beam
    char driver[BENCH_LINK]; // name or path of a profile, drivers/profile.h
    char bus[BENCH_NAME];
    int unit;                   // Modbus address
    char unit_name[8];          // "deg", "mm": what the following are in
    double steps_per_unit;      // sign: direction
    double encoder_steps;       // of the encoder, a motor step; 0 counts as 1
    double min, max;            // travel limits
    double sweep[2];            // where sweeps may go; stations may stand outside
    int sweep_count;            // 0: min and max, 2
    double speed, acceleration; // units/s, units/s^2
    int approach; // enum bench_approach: where positions are come to from, with backlash
    double backlash, deadband;
    int retries;            // further tries when it stands outside the deadband
    double following_error; // the most that it may be off its profile while it moves; 0: any
    double zero;            // position at step 0
};

enum bench_arm { BENCH_ARM_RUN, BENCH_ARM_EXPLICIT };

struct bench_laser {
    char driver[BENCH_LINK]; // likewise
    char link[BENCH_LINK];
    double power_w;
    double warmup_s;
    int arm;      // enum bench_arm: whether commands that start light arm the laser
    double arm_h; // for how long, if nobody says
    double align_power_w; // the most of an alignment session; 0: there is none
    int polarisation; // enum polarisation; POL_UNKNOWN is an answer, no answer is a mistake
};

struct bench_detector {
    char driver[BENCH_LINK]; // likewise
    char link[BENCH_LINK];
    double time_constant_s;
    int slope_db;           // 6, 12, 18, 24 per octave
    int monitor_aux;        // 1..4; 0: no monitor
    double u_linearity_rel; // standard uncertainty from beam to diffuse signal, relative
};

struct bench_mark {
    char name[BENCH_NAME]; // of an axis
    double at;             // user units
};

// A named place: "beam" is where the detector looks into the beam with the sample out. Kinematics
// makes axes of the angles; marks say where single axes stand, also those of the kinematics.
struct bench_station {
    char name[BENCH_NAME];
    double theta_i_deg, theta_r_deg, sample_mm;
    struct bench_mark marks[BENCH_AXES];
    int marks_count;
    char arrive[BENCH_STEP], leave[BENCH_STEP]; // what a person does before the axes go there, and
                                                // before they go elsewhere; "": nothing
    struct bench_place places[BENCH_DEVICES]; // of devices, while the axes stand there
    int places_count;
};

// Where two things would meet: a polygon in (theta_i, theta_r), deg, closed by itself.
struct bench_keep_out {
    char name[BENCH_NAME];
    double vertex[BENCH_VERTICES][2];
    int vertices;
};

struct bench_row {
    char axis[BENCH_NAME];
    double theta_i, theta_r, phi, polariser, analyser; // coefficients
    double offset;
};

// As written; bench_kinematics makes something of it.
struct bench_kinematics {
    int kind; // enum kinematics_kind
    struct bench_row rows[KINEMATICS_COORDINATES];
    int rows_count; // 0: the axes theta_i and theta_r are the angles themselves
    char tilt[BENCH_NAME], azimuth[BENCH_NAME], arm[BENCH_NAME]; // of the spherical kind
    char polariser[BENCH_NAME], analyser[BENCH_NAME];            // "": none
};

struct bench_config {
    char folder[BENCH_FOLDER]; // of the file, where its profiles may be; "": here
    char name[64];
    double wavelength_nm;
    int regime;                                      // enum bench_regime
    double aperture_radius_mm, u_aperture_radius_mm; // of the detector
    double distance_mm, u_distance_mm;               // sample to aperture
    struct bench_bus buses[BENCH_BUSES];
    int buses_count;
    struct bench_axis axes[BENCH_AXES];
    int axes_count;
    struct bench_kinematics kinematics;
    struct bench_keep_out keep_out[BENCH_KEEP_OUTS];
    int keep_out_count;
    struct bench_laser laser;
    struct bench_detector detector;
    struct bench_monitor monitor;
    struct bench_device devices[BENCH_DEVICES];
    int devices_count;
    struct bench_suspender suspenders[BENCH_SUSPENDERS];
    int suspenders_count;
    struct bench_polarisation polarisation;
    struct bench_station stations[BENCH_STATIONS];
    int stations_count;
    char directory[BENCH_FOLDER]; // where campaigns go; "": catalog_directory decides
    double step_limit_s;          // of a person's step, after which it is told again; 0: none
    struct {
        char argv[BENCH_NOTIFY][256]; // a program and its arguments
        int argc;                     // 0: nobody is told
        double limit_s;
    } notify;
};

extern const struct cfg_row bench_config_schema[];

// As campaign_config_load and campaign_config_parse.
int bench_config_load(const char *path, struct cfg_sink sink, struct bench_config *ret_bench,
                      char **ret_text);
int bench_config_parse(const char *text, const char *name, struct cfg_sink sink,
                       struct bench_config *ret_bench);

const struct bench_axis *bench_find_axis(const struct bench_config *b,
                                         const char *name); // NULL: none
const struct bench_station *bench_find_station(const struct bench_config *b, const char *name);
int bench_axis_index(const struct bench_config *b, const char *name); // -1: none
bool bench_axis_in_sweep(const struct bench_axis *a, double position);
// What of the axis's travel a move may cross, whether or not it must come round for the approach.
void bench_axis_span(const struct bench_axis *a, double from, double to, double *ret_low,
                     double *ret_high);
// How far from its target a position counts as reached: the deadband, at least half a step.
double bench_axis_tolerance(const struct bench_axis *a);
// Trapezoidal profile, triangular when short.
double bench_axis_move_s(const struct bench_axis *a, double from, double to);
double bench_axis_on_way(const struct bench_axis *a, double from, double to, double after_s);

// GON_E_INPUT: an axis that is not there, or what kinematics_linear says. Never after
// bench_config_load.
int bench_kinematics(const struct bench_config *b, struct kinematics *ret_kinematics,
                     struct gon_error *err);
// Where the axes stand at a station; NAN: where they are. GON_E_INPUT: out of reach.
int bench_station_at(const struct bench_config *b, const struct kinematics *k,
                     const struct bench_station *s, double ret_at[BENCH_AXES],
                     struct gon_error *err);
double bench_omega_sr(const struct bench_config *b); // pi r^2 / d^2
