// SPDX-License-Identifier: MIT
#include "sim/optics.h"
#include "base/units.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

double optics_solid_angle_sr(const struct optics_spec *o)
{
    double ratio = o->aperture_radius_mm / o->distance_mm;
    return UNITS_PI * ratio * ratio;
}

static struct brdf_geometry geometry(double theta_i_deg, double theta_r_deg)
{
    if (theta_i_deg < 0) { // a little below zero is the mirrored plane
        theta_i_deg = -theta_i_deg;
        theta_r_deg = -theta_r_deg;
    }
    return brdf_geometry(units_rad(theta_i_deg), units_rad(fabs(theta_r_deg)),
                         theta_r_deg < 0 ? 0 : UNITS_PI);
}

double optics_f_per_sr(const struct optics_spec *o, double theta_i_deg, double theta_r_deg)
{
    const struct brdf_geometry g = geometry(theta_i_deg, theta_r_deg);
    return brdf_f00(&o->sample, o->diffuse, &g);
}

// In plane s and p of both half planes are one frame of the laboratory: both change sign together.
double optics_between_per_sr(const struct optics_spec *o, const struct elements_view *view,
                             double theta_i_deg, double theta_r_deg)
{
    const struct brdf_geometry g = geometry(theta_i_deg, theta_r_deg);
    const struct brdf_mueller m = brdf_mueller(&o->sample, o->diffuse, &g);
    return elements_through(view, &m);
}

static double scattered_w(const struct optics_spec *o, const struct optics_scene *s)
{
    if (s->sample_mm > o->sample_in_mm || fabs(s->theta_r_deg) >= 90 || fabs(s->theta_i_deg) >= 90)
        return 0;
    double f_per_sr = s->view ? optics_between_per_sr(o, s->view, s->theta_i_deg, s->theta_r_deg)
                              : optics_f_per_sr(o, s->theta_i_deg, s->theta_r_deg);
    return s->power_w * f_per_sr * optics_solid_angle_sr(o) * cos(units_rad(s->theta_r_deg));
}

static double beam_w(const struct optics_spec *o, const struct optics_scene *s)
{
    if (s->sample_mm < o->sample_out_mm)
        return 0;
    double off_deg = fabs(remainder(s->theta_r_deg - (180 - s->theta_i_deg), 360));
    double aperture_deg = units_deg(atan(o->aperture_radius_mm / o->distance_mm));
    double edge = (off_deg - (aperture_deg - o->divergence_deg)) / (2 * o->divergence_deg); // 0..1
    double part = edge <= 0 ? 1 : edge >= 1 ? 0 : 0.5 * (1 + cos(UNITS_PI * edge));
    return s->power_w * o->transmission * part * (s->view ? elements_of_beam(s->view) : 1);
}

// Later imperfections (ambient light, head shadow, non-linearity, speckle, tilt) are more rows.
static const struct {
    const char *name;
    double (*detected_w)(const struct optics_spec *o, const struct optics_scene *s);
} terms[] = {
    {"scatter", scattered_w},
    {"beam", beam_w},
};

enum { TERMS = sizeof terms / sizeof terms[0] };

double optics_detected_w(const struct optics_spec *o, const struct optics_scene *s)
{
    double w = 0;
    if (s->power_w <= 0)
        return 0;
    for (int i = 0; i < TERMS; i++)
        if (!(o->off >> i & 1))
            w += terms[i].detected_w(o, s);
    return w;
}

int optics_term(const char *name)
{
    for (int i = 0; i < TERMS; i++)
        if (strcmp(terms[i].name, name) == 0)
            return i;
    return -1;
}

const char *optics_term_name(int term)
{
    return term >= 0 && term < TERMS ? terms[term].name : NULL;
}
