// SPDX-License-Identifier: MIT
// States of polarisation by name, and as Stokes vectors of unit intensity. The frame: s = z x k,
// p = k x s; S1 = |Es|^2 - |Ep|^2, S2 = 2 Re(Es Ep*), S3 = 2 Im(Ep Es*), time as exp(-i omega t);
// a polariser's angle counts from s towards +45. Thread: any.
#pragma once

enum brdf_state {
    BRDF_STATE_U,       // (1,0,0,0): unpolarised light; of a detector: no analyser
    BRDF_STATE_S,       // (1,1,0,0)
    BRDF_STATE_P,       // (1,-1,0,0)
    BRDF_STATE_PLUS45,  // (1,0,1,0)
    BRDF_STATE_MINUS45, // (1,0,-1,0)
    BRDF_STATE_R,       // (1,0,0,1)
    BRDF_STATE_L,       // (1,0,0,-1)
    BRDF_STATES
};

struct brdf_stokes {
    double s[4];
};

struct brdf_stokes brdf_state_stokes(enum brdf_state state);
// What a detector behind an ideal analyser for that state sees of light F: its product with F.
// Half the state's Stokes vector; (1,0,0,0) without an analyser.
struct brdf_stokes brdf_state_analyser(enum brdf_state state);

const char *brdf_state_name(enum brdf_state state); // "u", "s", "p", "+45", "-45", "R", "L"
int brdf_state_find(const char *name);              // enum brdf_state, or -1
