// SPDX-License-Identifier: MIT
// Elements of polarisation as they really are: a linear polariser in the laser's beam and one as
// analyser before the detector, each in a mount that turns it and swings it out of the beam. Stokes
// vectors and angles as in model/state.h: an angle counts from s towards +45. Pure, any thread.
//
// An element passes T of light along its axis and T e of crossed light. Its mount is an axis in
// deg: within -15..195 the element's angle; from 250 on the element is out of the beam and all
// light passes; between, the rim stands in the beam and nothing does.
#pragma once
#include "model/mueller.h"
#include "model/state.h"

#include <stdbool.h>

struct element_spec {
    double transmission, extinction; // T, e
};

struct elements_spec {
    bool present; // false: nothing is in the beam, and the mounts are not there
    int laser;    // state of the laser's own light, enum brdf_state
    struct element_spec polariser, analyser;
};

// What the optics needs of them.
struct elements_view {
    struct brdf_stokes light; // of a laser of 1 W, on the sample or in the beam's station
    struct brdf_stokes seen;  // the detected power is its product with the light that arrives
};

// Nothing polarises: the optics may do without a view.
bool elements_are_idle(const struct elements_spec *e);
struct elements_view elements_view(const struct elements_spec *e, double polariser_deg,
                                   double analyser_deg);
double elements_of_beam(const struct elements_view *v); // seen . light
double elements_through(const struct elements_view *v,
                        const struct brdf_mueller *m); // seen m light
