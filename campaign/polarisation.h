// SPDX-License-Identifier: MIT
// Polarisation states by name, in the Stokes frame s = (1,1,0,0), p = (1,-1,0,0), +45 = (1,0,1,0),
// -45 = (1,0,-1,0), R = (1,0,0,1), L = (1,0,0,-1), u = (1,0,0,0). Thread: any.
#pragma once

enum polarisation {
    POL_U, // of light: unpolarised; before the detector: no analyser
    POL_S,
    POL_P,
    POL_PLUS45,
    POL_MINUS45,
    POL_R,
    POL_L,
    POL_UNKNOWN, // of light only
    POL_COUNT,
    POL_KNOWN = POL_UNKNOWN // the states before are the model's (model/state.h)
};

extern const char
    *const polarisation_names[]; // "u", "s", "p", "+45", "-45", "R", "L", "unknown", NULL

const char *polarisation_name(enum polarisation p);
int polarisation_find(const char *name); // enum polarisation, or -1
// The other one of a pair: s and p, +45 and -45, R and L; of u and unknown the same.
enum polarisation polarisation_crossed(enum polarisation p);
// What an ideal analyser for `out` passes of a unit beam of state `in`: 1 for the same or without
// an analyser, 0 crossed, 1/2 otherwise. Unknown light counts as unpolarised.
double polarisation_passed(enum polarisation in, enum polarisation out);
