// SPDX-License-Identifier: MIT
// The analog and digital chain of a lock-in amplifier: input noise, phase, 1 to 4 equal RC poles,
// full scale with overloads. It is driven in steps of constant input (exact for that input,
// whatever the step), and white noise of the right variance enters with each step, so that
// successive readings are correlated as a real filter's are. Volts are rms. Thread: one.
#pragma once
#include "sim/noise.h"

#include <stdbool.h>
#include <stdint.h>

enum { LOCKIN_POLES = 4 };

// Bits of the SR830's LIAS? (pymeasure/pymeasure:pymeasure/instruments/srs/sr830.py, and the
// manual, which on page 5-23 makes them sticky until read).
enum lockin_condition {
    LOCKIN_INPUT_OVERLOAD = 1 << 0,
    LOCKIN_FILTER_OVERLOAD = 1 << 1,
    LOCKIN_OUTPUT_OVERLOAD = 1 << 2,
    LOCKIN_UNLOCKED = 1 << 3
};

struct lockin {
    double noise_v_per_rthz; // white input noise, one-sided
    // settings
    double time_constant_s;
    int poles; // 1..4 = 6..24 dB per octave
    double full_scale_v;
    double reserve;   // input overload at this many full scales, but never above 1.4 V
    double phase_rad; // of the reference against the signal
    // state
    double x[LOCKIN_POLES], y[LOCKIN_POLES];
    unsigned condition;      // sticky; whoever reads clears
    double dt_s, keep, sd_v; // of the last step: steps are often alike
    double turn_x, turn_y;   // cosine and sine of turned_rad
    double of_time_constant_s, turned_rad;
    struct noise noise;
};

void lockin_init(struct lockin *l, double noise_v_per_rthz, uint64_t seed);
// The input is signal_v for dt_s > 0.
void lockin_step(struct lockin *l, double signal_v, double dt_s);
// Outputs as the display shows them: clipped at 109 % of full scale, in steps of full scale /
// 65536.
double lockin_x_v(const struct lockin *l);
double lockin_y_v(const struct lockin *l);
