// SPDX-License-Identifier: MIT
// The model as the paper writes it, with complex numbers and angles, and the mistakes that its
// print invites, so that a test can say which one somebody made. Slow, and loses digits near
// backscatter (1e-16/beta^2): a peer of model/, never its replacement.
#pragma once
#include "model/brdf.h"

#include <complex.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

enum misreading {
    MISREAD_NOTHING,
    MISREAD_INDEX,       // 1
    MISREAD_EXPONENT,    // 2
    MISREAD_ALPHA_R,     // 3
    MISREAD_SINES,       // 4
    MISREAD_RS_SIGN,     // 5
    MISREAD_ANGLE,       // 6
    MISREAD_DIFFUSE,     // 8
    MISREAD_HALF_PLANE,  // 13
    MISREAD_NO_SHADOWING // 14
};
#define MISREADINGS (MISREAD_NO_SHADOWING + 1)

static const char *const misreading_name[MISREADINGS] = {
    "nothing",
    "N^2 = n + ik instead of (n + ik)^2 (erratum 1)",
    "exp(-tan^2/sigma^2) instead of exp(-tan^2/(2 sigma^2)) (erratum 2)",
    "cos alpha_r with cos theta_i cos beta instead of cos theta_r cos beta (erratum 3)",
    "sin alpha without the sign of sin dphi (erratum 4)",
    "rs with the wrong sign (erratum 5)",
    "Fresnel's equations at theta_i instead of the local angle beta (erratum 6)",
    "kd in all elements instead of f_00 alone (erratum 8)",
    "dphi = 0 taken for the specular half plane (erratum 13)",
    "G left out (erratum 14)",
};

// Eq. 14: m_jk of a Jones matrix, whose first letter is the incident polarisation.
static inline void mueller_of_jones(double complex ss, double complex ps, double complex sp,
                                    double complex pp, double m[4][4])
{
    const double ss2 = pow(cabs(ss), 2), ps2 = pow(cabs(ps), 2);
    const double sp2 = pow(cabs(sp), 2), pp2 = pow(cabs(pp), 2);
    const double complex row0 = ss * conj(ps) + sp * conj(pp), row1 = ss * conj(ps) - sp * conj(pp);
    const double complex col0 = ss * conj(sp) + ps * conj(pp), col1 = ss * conj(sp) - ps * conj(pp);
    const double complex sum = ss * conj(pp) + ps * conj(sp), diff = ss * conj(pp) - ps * conj(sp);
    const double all[4][4] = {
        {(ss2 + pp2 + ps2 + sp2) / 2, (ss2 + sp2 - ps2 - pp2) / 2, creal(row0), cimag(row0)},
        {(ss2 + ps2 - sp2 - pp2) / 2, (ss2 + pp2 - ps2 - sp2) / 2, creal(row1), cimag(row1)},
        {creal(col0), creal(col1), creal(sum), cimag(diff)},
        {-cimag(col0), -cimag(col1), -cimag(sum), creal(diff)}};
    memcpy(m, all, sizeof all);
}

struct alphas {
    double cos_i, sin_i, cos_r, sin_r;
};

static inline struct alphas transcribe_alphas(double ti, double tr, double dphi, double cos_beta,
                                              double sin_beta, enum misreading wrong)
{
    const double s2 = 2 * sin_beta * cos_beta;
    struct alphas a = {
        (sin(ti) * cos(tr) - cos(ti) * sin(tr) * cos(dphi)) / s2, sin(tr) * sin(dphi) / s2,
        (sin(tr) * cos(ti) - cos(tr) * sin(ti) * cos(dphi)) / s2, sin(ti) * sin(dphi) / s2};
    const double cos_theta = (cos(ti) + cos(tr)) / (2 * cos_beta);
    if (wrong == MISREAD_ALPHA_R) {
        a.cos_r = (cos_theta - cos(ti) * cos_beta) / (sin(tr) * sin_beta);
        a.sin_r = copysign(sqrt(fmax(0, 1 - a.cos_r * a.cos_r)), sin(dphi));
    }
    if (wrong == MISREAD_SINES) {
        a.sin_i = fabs(a.sin_i);
        a.sin_r = fabs(a.sin_r);
    }
    return a;
}

// The facet's matrix m_jk at local angle beta.
static inline void transcribe_facet(double n, double k, double beta, const struct alphas *a,
                                    enum misreading wrong, double m[4][4])
{
    const double complex index = n + k * (double complex)_Complex_I;
    const double complex eps = wrong == MISREAD_INDEX ? index : index * index;
    const double complex q = csqrt(eps - pow(sin(beta), 2));
    const double complex rp = (eps * cos(beta) - q) / (eps * cos(beta) + q);
    double complex rs = (cos(beta) - q) / (cos(beta) + q);
    rs = wrong == MISREAD_RS_SIGN ? -rs : rs;
    mueller_of_jones(rs * a->cos_r * a->cos_i + rp * a->sin_r * a->sin_i,
                     rs * a->cos_r * a->sin_i - rp * a->sin_r * a->cos_i,
                     rs * a->sin_r * a->cos_i - rp * a->cos_r * a->sin_i,
                     rs * a->sin_r * a->sin_i + rp * a->cos_r * a->cos_i, m);
}

// Eq. 16 with the paper's diffuse term; angles in rad.
static inline void transcribe(const struct brdf_params *p, double ti, double tr, double dphi,
                              enum misreading wrong, double f[4][4])
{
    dphi = wrong == MISREAD_HALF_PLANE ? dphi + acos(-1) : dphi;
    const double hx = sin(ti) + sin(tr) * cos(dphi), hy = sin(tr) * sin(dphi);
    const double hz = cos(ti) + cos(tr), h = sqrt(hx * hx + hy * hy + hz * hz);
    const double cos_beta = h / 2, sin_beta = sqrt(fmax(0, 1 - cos_beta * cos_beta));
    const double cos_t = hz / h, tan2_t = (hx * hx + hy * hy) / (hz * hz);
    const double g =
        wrong == MISREAD_NO_SHADOWING ? 1 : fmin(1, 2 * cos_t * fmin(cos(ti), cos(tr)) / cos_beta);
    const double width = (wrong == MISREAD_EXPONENT ? 1 : 2) * p->sigma * p->sigma;
    const double c = p->ks / (2 * acos(-1)) / (4 * p->sigma * p->sigma) * g / pow(cos_t, 4) *
                     exp(-tan2_t / width) / (cos(ti) * cos(tr));
    const struct alphas a = transcribe_alphas(ti, tr, dphi, cos_beta, sin_beta, wrong);
    transcribe_facet(p->n, p->k, wrong == MISREAD_ANGLE ? ti : asin(sin_beta), &a, wrong, f);
    for (int j = 0; j < 16; j++) {
        f[j / 4][j % 4] *= c;
        if (j == 0 || wrong == MISREAD_DIFFUSE)
            f[j / 4][j % 4] += p->kd / cos(ti);
    }
}
