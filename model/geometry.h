// SPDX-License-Identifier: MIT
// A pair of directions, and all of the model that depends on them alone.
//
// Angles in radians: theta_i, theta_r in [0, pi/2); dphi = phi_r - phi_i, pi is the specular half
// plane (eq. 6 of Feng et al. 2008). An azimuth within 1e-15 of the plane of incidence is taken
// for it, because 180 deg has no double in radians. Outside the domain all members are NAN. Pure:
// any thread.
#pragma once

// From the frame of the surface to the frame of the facet, eq. 10 with its errata 3 and 4 mended:
// alpha turns s of a direction (z x k: defined by the azimuth, also at normal incidence) into s of
// the facet's plane of incidence. At exact backscatter that plane is undefined and any will do.
struct brdf_rotation {
    double cos_i, sin_i; // alpha_i
    double cos_r, sin_r; // alpha_r
};

// cos(2 alpha): Stokes vectors turn by twice the angle.
static inline double brdf_cos_twice(double cos_alpha, double sin_alpha)
{
    return (cos_alpha - sin_alpha) * (cos_alpha + sin_alpha);
}

struct brdf_geometry {
    double tan2_theta; // of the facet's normal against the surface's
    double sin2_beta;  // local angle of incidence on the facet
    double cos2_beta;
    double spec_per_sr; // A = G / (4 pi cos^4 theta cos theta_i cos theta_r)
    double inv_cos_i;   // 1/cos theta_i
    struct brdf_rotation rotation;
};

// Full relative accuracy at specular, at backscatter and at grazing; the rotation: some ulp of 1.
// Exchanging the directions (theta_i with theta_r, dphi with -dphi) or the sign of dphi changes
// nothing but signs, to the last bit: reciprocity and mirror symmetry of the model are exact.
struct brdf_geometry brdf_geometry(double theta_i_rad, double theta_r_rad, double dphi_rad);
