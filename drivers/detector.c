// SPDX-License-Identifier: MIT
#include "drivers/detector.h"

#include <math.h>

// What is left of a step behind n equal poles after x time constants: e^-x sum of x^k/k!, k < n.
static double residual_after(int poles, double x)
{
    double term = 1.0, sum = 1.0;
    for (int k = 1; k < poles; k++) {
        term *= x / k;
        sum += term;
    }
    return sum * exp(-x);
}

double detector_settle_s(double time_constant_s, int slope_db, double residual)
{
    const int poles = slope_db / 6;
    if (poles < 1 || poles > 4 || slope_db % 6 || !(residual > 0))
        return (double)NAN;
    if (residual >= 1)
        return 0.0;
    double near = 0.0, far = 800.0; // e^-745 is the smallest double
    for (int i = 0; i < 60; i++) {  // bisection: it falls monotonically
        const double x = 0.5 * (near + far);
        if (residual_after(poles, x) > residual)
            near = x;
        else
            far = x;
    }
    return far * time_constant_s;
}
