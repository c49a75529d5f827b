// SPDX-License-Identifier: MIT
// Fresnel's coefficients of a facet at the local angle beta (erratum 6), for the index N = n + ik
// and the permittivity N^2 (erratum 1), time as exp(-i omega t):
//
//   rs = (cos beta - q)/(cos beta + q),  rp = (N^2 cos beta - q)/(N^2 cos beta + q),
//   q = sqrt(N^2 - sin^2 beta)                                          (eqs. 11-13, erratum 5)
//
// n in (0, BRDF_INDEX_MAX], k in [0, BRDF_INDEX_MAX]; outside NAN. Pure: any thread.
#pragma once

#define BRDF_INDEX_MAX 1e50 // beyond it squares of squares overflow

// All that a Mueller matrix takes of rs and rp. ss pp = re^2 + im^2.
struct brdf_fresnel {
    double ss; // |rs|^2
    double pp; // |rp|^2
    double re; // of rs times the conjugate of rp: -|r|^2 at normal incidence
    double im;
};

// In real arithmetic. ss is good to a few ulp, also where it nearly vanishes (n near 1) and at
// total reflection (n < 1); the others are good to a few ulp of ss.
struct brdf_fresnel brdf_fresnel(double n, double k, double sin2_beta, double cos2_beta);

// (|rs|^2 + |rp|^2)/2, to a few ulp: what f_00 needs.
double brdf_fresnel_mean(double n, double k, double sin2_beta, double cos2_beta);
