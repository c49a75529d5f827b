// SPDX-License-Identifier: MIT
// A pair of directions in a CSV: theta_i_deg with theta_r_signed_deg (in plane, >= 0 is forward) or
// with theta_r_deg and dphi_deg. The signed column is taken when both are there. Thread: any.
#pragma once
#include "campaign/csv.h"

struct direction {
    double theta_i_deg, theta_r_deg; // in [0, 90)
    double dphi_deg;                 // phi_r - phi_i, 180 is the specular half plane
};

struct direction_columns {
    int theta_i;
    int theta_r_signed; // -1: theta_r and dphi are there
    int theta_r, dphi;  // -1: theta_r_signed is there
};

// Errors are GON_E_INPUT with file and line: no such column; not a number, or outside [0, 90) and
// (-90, 90).
int direction_find(const struct csv *c, struct direction_columns *ret_columns,
                   struct gon_error *err);
int direction_take(const struct csv *c, const struct direction_columns *columns,
                   struct direction *ret_direction, struct gon_error *err);

struct direction direction_in_plane(double theta_i_deg, double theta_r_signed_deg);
