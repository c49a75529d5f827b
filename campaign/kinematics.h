// SPDX-License-Identifier: MIT
// Kinematics: between the geometry of a reading and where the axes of a bench stand. Pure, degrees
// throughout, any thread. Positions are arrays with an element an axis, in the bench's order and in
// the axes' own user units; NAN is an axis that is not asked for or not known.
//
// The pose
//   theta_i     angle of incidence, >= 0
//   theta_r     signed: positive on the forward side (specular at theta_r = theta_i), negative
//   back;
//               continuous across the normal
//   phi         spherical: how far the plane of reflection is turned out of the plane of incidence
//               about the sample's normal; dphi = phi_r - phi_i = 180 deg + phi for theta_r >= 0,
//               phi for theta_r < 0, which is one plane. -90 < phi <= 90; 0 is in plane.
//               linear, always in plane: the sample's azimuth about its own normal
//   polariser   of the incident light, analyser of the reflected: from s towards +45
//   (model/state.h:
//               s = z x k, p = k x s). NAN: not asked, so that the axis stays
//
// linear: at = matrix x pose + offset, a row an axis. Source arm: theta_i; detector arm that turns
// about the source's direction: arm = theta_i + theta_r; sample rotation: sample = theta_i. As many
// rows as there are coordinates with a coefficient, and these must be told apart (the matrix is
// inverted). Every pose is reachable, but a coordinate without an axis is 0.
//
// spherical: the source stands still. z points from the sample to the source, x is horizontal, y is
// up; all three axes meet in the middle of the sample.
//   arm a       turns the detector about y: its direction is d = (sin a, 0, cos a), so that the
//               straight-through beam is at a = 180 deg
//   azimuth u   turns the plane of the tilt about z, the beam
//   tilt t      takes the normal from the beam in that plane: n = (sin t cos u, sin t sin u, cos t)
// Then theta_i = t. With e = (cos u, sin u, 0), f = (-sin u, cos u, 0) the sample's own frame is
// x' = sin t z - cos t e (towards the source), y' = -f, n; and d in it,
//   d.x' = sin t cos a - cos t sin a cos u = -sin theta_r cos phi
//   d.y' =               sin a sin u       = -sin theta_r sin phi
//   d.n  = cos t cos a + sin t sin a cos u =  cos theta_r
// gives theta_r and phi. The inverse resolves the same vector along e, f and z instead:
//   sin a cos u = sin t cos theta_r + cos t sin theta_r cos phi          (along e)
//   sin a sin u = -sin theta_r sin phi                                   (along -f)
//   cos a       = cos t cos theta_r - sin t sin theta_r cos phi
// Of its two solutions (a, u) and (-a, u + 180 deg) the one with |u| <= 90 deg is taken: in plane u
// is 0 and a = theta_i + theta_r, as with a detector arm, and u does not jump when theta_r passes
// the normal. Out of plane it jumps where the first line passes 0, behind backscatter. Degenerate:
// - theta_i = 0: n is the beam, and u is what turns the sample's frame, so nothing is special
// - exact backscatter and straight through, sin a = 0: any u will do, 0 is taken
// - theta_r = 0: phi means nothing and comes back as 0; analyser angles do not
// s and p turn with n. The polariser's axis counts from y about the beam and the analyser's about
// the arm from y, both like their angles in the plane of s and p, so that in plane both are the
// angles themselves. Elsewhere
//   polariser's axis = polariser - u
//   analyser's axis  = analyser + w,  s = sin phi x' + cos phi f = cos w y + sin w (d x y)
// with w within (-180, 180], continuous where u is.
#pragma once
#include "base/err.h"

#include <stdbool.h>

enum {
    KINEMATICS_AXES = 12, // the most that a bench has
    KINEMATICS_COORDINATES = 5,
    KINEMATICS_ROLES = 5
};

enum kinematics_kind { KINEMATICS_LINEAR, KINEMATICS_SPHERICAL };

struct kinematics_pose {
    double theta_i, theta_r, phi, polariser, analyser;
};

// One axis of the linear kind.
struct kinematics_row {
    int axis;                          // its index in the bench
    double of[KINEMATICS_COORDINATES]; // coefficients, in the order of struct kinematics_pose
    double offset;
};

// Who plays the parts of the spherical kind: indices in the bench; polariser and analyser may be
// -1.
struct kinematics_roles {
    int tilt, azimuth, arm, polariser, analyser;
};

struct kinematics {
    enum kinematics_kind kind;
    int count;                              // of linear: rows, and coordinates they move
    int axis[KINEMATICS_COORDINATES];       // of each row
    int coordinate[KINEMATICS_COORDINATES]; // that has an axis
    double matrix[KINEMATICS_COORDINATES][KINEMATICS_COORDINATES];  // [row][moved coordinate]
    double inverse[KINEMATICS_COORDINATES][KINEMATICS_COORDINATES]; // [moved coordinate][row]
    double offset[KINEMATICS_COORDINATES];
    struct kinematics_roles roles; // of spherical
};

extern const char *const kinematics_kinds[];       // "linear", "spherical", NULL
extern const char *const kinematics_coordinates[]; // "theta_i", ..., "analyser", NULL

// GON_E_INPUT, in words for whoever wrote the rows: theta_i or theta_r has no axis, more or fewer
// rows than coordinates, or rows that cannot be told apart.
int kinematics_linear(const struct kinematics_row *rows, int count,
                      struct kinematics *ret_kinematics, struct gon_error *err);
struct kinematics kinematics_spherical(const struct kinematics_roles *roles);

// Where the axes must stand: all that take no part are NAN. GON_E_INPUT: what of the pose cannot be
// reached, and why. Limits of axes are the caller's.
int kinematics_inverse(const struct kinematics *k, const struct kinematics_pose *pose,
                       double ret_at[KINEMATICS_AXES], struct gon_error *err);
// What the axes' positions mean. NAN where an axis is not known; a coordinate without axis is 0.
struct kinematics_pose kinematics_forward(const struct kinematics *k,
                                          const double at[KINEMATICS_AXES]);
// Whether theta_i or theta_r depends on that axis.
bool kinematics_steers(const struct kinematics *k, int axis);

// Bounds of theta_i and theta_r while each axis is anywhere within half[] of at[].
struct kinematics_reach {
    double theta_i, theta_r;           // in the middle
    double half_theta_i, half_theta_r; // at most so far from there
    bool mirrored;                     // or around -theta_r
};
struct kinematics_reach kinematics_reach(const struct kinematics *k,
                                         const double at[KINEMATICS_AXES],
                                         const double half[KINEMATICS_AXES]);
