// SPDX-License-Identifier: MIT
#include "fit/eigen.h"

#include <math.h>
#include <string.h>

enum { N = FIT_PARAMS, SWEEPS = 30 };

// Turns a[p][q] to zero; false when it is nothing beside its own diagonal already, which keeps
// small eigenvalues accurate (Demmel and Veselic 1992).
static bool rotate(double a[N][N], double v[N][N], int p, int q)
{
    if (a[p][q] * a[p][q] <= 1e-34 * fabs(a[p][p] * a[q][q]))
        return false;
    double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
    double t = copysign(1, theta) / (fabs(theta) + sqrt(theta * theta + 1));
    double c = 1 / sqrt(t * t + 1), s = t * c;
    for (int i = 0; i < N; i++) {
        double x = a[i][p], y = a[i][q];
        a[i][p] = c * x - s * y;
        a[i][q] = s * x + c * y;
    }
    for (int i = 0; i < N; i++) {
        double x = a[p][i], y = a[q][i], vx = v[p][i], vy = v[q][i];
        a[p][i] = c * x - s * y;
        a[q][i] = s * x + c * y;
        v[p][i] = c * vx - s * vy;
        v[q][i] = s * vx + c * vy;
    }
    a[p][q] = a[q][p] = 0;
    return true;
}

void eigen_symmetric(const double a[N][N], double ret_value[N], double ret_vector[N][N])
{
    double work[N][N];
    memcpy(work, a, sizeof work);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            ret_vector[i][j] = i == j;
    bool turned = true;
    for (int sweep = 0; sweep < SWEEPS && turned; sweep++) {
        turned = false;
        for (int p = 0; p < N; p++)
            for (int q = p + 1; q < N; q++)
                turned |= rotate(work, ret_vector, p, q);
    }
    for (int i = 0; i < N; i++)
        ret_value[i] = work[i][i];
}
