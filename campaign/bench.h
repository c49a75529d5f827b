// SPDX-License-Identifier: MIT
// The bench file goniod.cfg: the instrument as data. Plain data, no drivers; man goniod.cfg(5) is
// printed from its table. Thread: any.
#pragma once
#include "base/cfg.h"
#include "base/err.h"
#include "campaign/polarisation.h"

enum {
    BENCH_BUSES = 4,
    BENCH_AXES = 3,
    BENCH_STATIONS = 16,
    BENCH_NAME = 32,
    BENCH_LINK = 256,
    BENCH_FOLDER = 256
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

struct bench_axis {
    char name[BENCH_NAME];   // "theta_i", "theta_r", "sample"
    char driver[BENCH_LINK]; // name or path of a profile, drivers/profile.h
    char bus[BENCH_NAME];
    int unit;                   // Modbus address
    char unit_name[8];          // "deg", "mm": what the following are in
    double steps_per_unit;      // sign: direction
    double min, max;            // travel limits
    double speed, acceleration; // units/s, units/s^2
    double backlash, deadband;
    double zero; // position at step 0
};

struct bench_laser {
    char driver[BENCH_LINK]; // likewise
    char link[BENCH_LINK];
    double power_w;
    double warmup_s;
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

// Named axis coordinates: "beam" is where the detector looks into the beam with the sample out.
struct bench_station {
    char name[BENCH_NAME];
    double theta_i_deg, theta_r_deg, sample_mm;
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
    struct bench_laser laser;
    struct bench_detector detector;
    struct bench_station stations[BENCH_STATIONS];
    int stations_count;
    char directory[BENCH_FOLDER]; // where campaigns go; "": catalog_directory decides
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
double bench_omega_sr(const struct bench_config *b); // pi r^2 / d^2
