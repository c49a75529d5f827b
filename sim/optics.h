// SPDX-License-Identifier: MIT
// What reaches the detector: pure functions of where things really are (the loads of the axes) and
// of the laser's power. Angles in deg, lengths in mm, power in W. Thread: any.
//
// A table of terms adds up; each can be switched off by its name. There are the sample's
// scattering,
//   P f00(theta_i, theta_r) Omega cos theta_r        sample in, |theta_r| < 90 deg (underfilled)
// with theta_r signed (positive: specular half plane), and the straight-through beam,
//   P T     sample out, theta_r = 180 deg - theta_i within the aperture,
// flat inside aperture less divergence, smooth over twice the divergence, nothing beyond. Anywhere
// else it is dark. With a view of the elements of polarisation (sim/elements.h) f00 is the sample's
// Mueller matrix between the light and what the detector sees of it, and T is that of the beam.
// Without one the light is unpolarised and nothing analyses it. Point values: no convolution with
// the aperture, no shadow of the detector's head.
#pragma once
#include "model/brdf.h"
#include "sim/elements.h"

#include <stdbool.h>

struct optics_spec {
    struct brdf_params sample;
    enum brdf_diffuse diffuse;
    double aperture_radius_mm, distance_mm;
    double divergence_deg;              // half angle of the beam
    double transmission;                // T of the straight-through path
    double sample_in_mm, sample_out_mm; // stage: in the beam at or below; out of it at or above
    unsigned off;                       // bit n: the n-th term is switched off
};

struct optics_scene {
    double theta_i_deg, theta_r_deg, sample_mm;
    double power_w;                   // of the laser's beam
    const struct elements_view *view; // NULL: nothing polarises
};

double optics_solid_angle_sr(const struct optics_spec *o);
double optics_detected_w(const struct optics_spec *o, const struct optics_scene *s);
double optics_f_per_sr(const struct optics_spec *o, double theta_i_deg,
                       double theta_r_deg); // NAN outside
double optics_between_per_sr(const struct optics_spec *o, const struct elements_view *view,
                             double theta_i_deg,
                             double theta_r_deg); // the same behind the elements
int optics_term(const char *name);                // its number, or -1
const char *optics_term_name(int term);           // NULL after the last
