// SPDX-License-Identifier: MIT
// The bench that simbench's world is: realistic speeds, a filter of 100 ms with 12 dB per octave.
#pragma once
#include "campaign/bench.h"

#include <stdio.h>
#include <string.h>

static inline void simconfig_axis(struct bench_axis *a, const char *name, const char *unit,
                                  double min, double max)
{
    *a = (struct bench_axis){.steps_per_unit = 1000,
                             .min = min,
                             .max = max,
                             .speed = 20,
                             .acceleration = 60,
                             .backlash = 0.02,
                             .deadband = 0.003,
                             .retries = 2};
    snprintf(a->name, sizeof a->name, "%s", name);
    snprintf(a->driver, sizeof a->driver, "oriental-az");
    snprintf(a->unit_name, sizeof a->unit_name, "%s", unit);
}

static inline void simconfig_station(struct bench_station *s, const char *name, double theta_r_deg,
                                     double sample_mm)
{
    *s = (struct bench_station){.theta_r_deg = theta_r_deg, .sample_mm = sample_mm};
    snprintf(s->name, sizeof s->name, "%s", name);
}

static inline void simconfig_bench(struct bench_config *b)
{
    memset(b, 0, sizeof *b);
    b->aperture_radius_mm = 8;
    b->distance_mm = 500;
    b->axes_count = 3;
    simconfig_axis(&b->axes[0], "theta_i", "deg", -5, 88);
    simconfig_axis(&b->axes[1], "theta_r", "deg", -180, 180);
    simconfig_axis(&b->axes[2], "sample", "mm", 0, 30);
    b->axes[2].backlash = 0;
    snprintf(b->laser.driver, sizeof b->laser.driver, "cobolt-05");
    snprintf(b->detector.driver, sizeof b->detector.driver, "sr830");
    b->laser.power_w = 0.05;
    b->laser.warmup_s = 60;
    b->detector.time_constant_s = 0.1;
    b->detector.slope_db = 12;
    b->detector.monitor_aux = 1;
    b->stations_count = 2;
    simconfig_station(&b->stations[0], "beam", 180, 30);
    simconfig_station(&b->stations[1], "park", 0, 0);
}
