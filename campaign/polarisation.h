// SPDX-License-Identifier: MIT
// Polarisation states by name, in the Stokes frame s = (1,1,0,0), p = (1,-1,0,0), +45 = (1,0,1,0),
// -45 = (1,0,-1,0), R = (1,0,0,1), L = (1,0,0,-1), u = (1,0,0,0). Thread: any.
#pragma once

enum polarisation { POL_U, POL_S, POL_P, POL_PLUS45, POL_MINUS45, POL_R, POL_L, POL_UNKNOWN };

extern const char
    *const polarisation_names[]; // "u", "s", "p", "+45", "-45", "R", "L", "unknown", NULL

const char *polarisation_name(enum polarisation p);
int polarisation_find(const char *name); // enum polarisation, or -1
