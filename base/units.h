// SPDX-License-Identifier: MIT
// The one place where degrees become radians. Degrees everywhere outside model/ and fit/.
#pragma once
#include <math.h>
#include <stdint.h>

#define UNITS_PI 3.14159265358979323846
#define UNITS_UDEG_PER_DEG 1000000.0

static inline double units_rad(double deg)
{
    return deg * (UNITS_PI / 180.0);
}

static inline double units_deg(double rad)
{
    return rad * (180.0 / UNITS_PI);
}

// Micro-degrees are how angles are stored: exact to 1e-6 deg, equal when they are equal.
static inline int64_t units_udeg(double deg)
{
    return llround(deg * UNITS_UDEG_PER_DEG);
}

static inline double units_deg_of_udeg(int64_t udeg)
{
    return (double)udeg / UNITS_UDEG_PER_DEG;
}
