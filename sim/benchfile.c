// SPDX-License-Identifier: MIT
#include "sim/benchfile.h"

#include <stdbool.h>
#include <string.h>

// A number that libconfig reads as a real, whatever its value.
static const char *real(char text[32], double v)
{
    snprintf(text, 32, "%.10g", v);
    for (const char *p = text; *p; p++)
        if (*p == '.' || *p == 'e')
            return text;
    size_t n = 0;
    while (text[n])
        n++;
    snprintf(text + n, 32 - n, ".0");
    return text;
}

static void axis(FILE *out, const struct sim_config *c, int unit, const char *name,
                 const char *unit_name, double min, double max, double backlash, const char *end)
{
    char t[6][32];
    fprintf(out,
            "  { name = \"%s\"; driver = \"%s\"; bus = \"axes\"; unit = %d; unit_name = "
            "\"%s\"; "
            "steps_per_unit = %s;\n    min = %s; max = %s; speed = %s; acceleration = %s; ",
            name, *c->axes_profile ? c->axes_profile : bench_controllers[c->bench.controller], unit,
            unit_name, real(t[0], c->steps_per_unit), real(t[1], min), real(t[2], max),
            real(t[3], c->speed), real(t[4], c->acceleration));
    fprintf(out, "backlash = %s; deadband = %s; }%s\n", real(t[0], backlash),
            real(t[1], 3 / c->steps_per_unit), end);
}

static void geometry(FILE *out, const struct sim_config *c)
{
    char t[2][32];
    fprintf(out,
            "bench:\n{\n  name = \"simulated bench\";\n  wavelength_nm = 1060.0;\n  regime = "
            "\"underfilled\";\n"
            "  aperture_radius_mm = %s;\n  u_aperture_radius_mm = 0.004;\n"
            "  distance_mm = %s;\n  u_distance_mm = 0.25;\n};\n",
            real(t[0], c->bench.world.optics.aperture_radius_mm),
            real(t[1], c->bench.world.optics.distance_mm));
}

static bool has(const struct profile *p, const char *value)
{
    for (int i = 0; i < p->values_count; i++)
        if (strcmp(p->values[i].name, value) == 0)
            return true;
    return false;
}

// A detector without a filter of its own settles as one pole does.
static void detector(FILE *out, const struct sim_config *c, const char *link)
{
    char t[32];
    const struct profile *p = c->bench.detector;
    fprintf(out,
            "detector: { driver = \"%s\"; link = \"%s\"; time_constant_s = %s; slope_db = %d; "
            "monitor_aux = %d; u_linearity_rel = 0.0; };\n",
            p ? c->detector_profile : "sr830", link, real(t, c->time_constant_s),
            p && !has(p, "slope_db") ? 6 : c->slope_db, p && !*p->detector.monitor ? 0 : 1);
}

static void instruments(FILE *out, const struct sim_config *c, const struct benchfile_links *links)
{
    char t[2][32];
    fprintf(out,
            "laser: { driver = \"%s\"; link = \"%s\"; power_w = %s; warmup_s = %s; "
            "polarisation = \"%s\"; };\n",
            c->bench.laser ? c->laser_profile : "cobolt-05", links->laser, real(t[0], c->power_w),
            real(t[1], c->bench.world.laser.warmup_s),
            brdf_state_name((enum brdf_state)c->bench.world.elements.laser));
    detector(out, c, links->detector);
}

static void state(FILE *out, enum brdf_state is, const char *axis_name, double at, const char *end)
{
    char t[32];
    fprintf(out, "    { is = \"%s\"; axes = ( { name = \"%s\"; at = %s; } ); }%s\n",
            brdf_state_name(is), axis_name, real(t, at), end);
}

// What linear elements make; the polariser out of the beam leaves the laser's own light.
static void states(FILE *out, const char *side, const char *axis_name, enum brdf_state out_is)
{
    static const enum brdf_state is[] = {BRDF_STATE_S, BRDF_STATE_PLUS45, BRDF_STATE_P,
                                         BRDF_STATE_MINUS45};
    bool made = false;
    fprintf(out, "  %s = (\n", side);
    for (int i = 0; i < 4; i++)
        made = made || is[i] == out_is;
    for (int i = 0; i < 4; i++)
        state(out, is[i], axis_name, 45.0 * i, i < 3 || !made ? "," : "");
    if (!made)
        state(out, out_is, axis_name, 270, "");
    fprintf(out, "  );\n");
}

// What is known of the elements is what they are: their transmission to 0.2 %.
static void elements(FILE *out, const struct elements_spec *e)
{
    char t[4][32];
    fprintf(out, "polarisation:\n{\n");
    states(out, "pol_in", "polariser", (enum brdf_state)e->laser);
    states(out, "pol_out", "analyser", BRDF_STATE_U);
    fprintf(out, "  polariser: { extinction = %s; };\n", real(t[0], e->polariser.extinction));
    fprintf(out, "  analyser: { transmission = %s; u_transmission = %s; extinction = %s; };\n};\n",
            real(t[1], e->analyser.transmission), real(t[2], 0.002 * e->analyser.transmission),
            real(t[3], e->analyser.extinction));
}

void benchfile_write(FILE *out, const struct sim_config *c, const struct benchfile_links *links)
{
    double backlash = c->backlash > 0 ? c->backlash + 0.005 : 0; // a little more than there is
    fprintf(out, "# Written by goniosim %s, seed %d.\n", GONIO_VERSION, c->seed);
    geometry(out, c);
    fprintf(out, "buses: ( { name = \"axes\"; link = \"%s\"; timeout_ms = 200; } );\naxes: (\n",
            links->axes);
    axis(out, c, 1, "theta_i", "deg", -5, 88, backlash, ",");
    axis(out, c, 2, "theta_r", "deg", -180, 180, backlash, ",");
    axis(out, c, 3, "sample", "mm", 0, 30, 0, c->bench.world.elements.present ? "," : "");
    if (c->bench.world.elements.present) {
        axis(out, c, 4, "polariser", "deg", -10, 280, backlash, ",");
        axis(out, c, 5, "analyser", "deg", -10, 280, backlash, "");
    }
    fprintf(out, ");\n");
    instruments(out, c, links);
    if (c->bench.world.elements.present)
        elements(out, &c->bench.world.elements);
    fprintf(out,
            "stations: (\n"
            "  { name = \"beam\"; theta_i_deg = 0.0; theta_r_deg = 180.0; sample_mm = 30.0; },\n"
            "  { name = \"park\"; theta_i_deg = 0.0; theta_r_deg = 0.0; sample_mm = 0.0; }\n);\n");
}
