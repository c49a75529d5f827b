// SPDX-License-Identifier: MIT
#include "sim/benchfile.h"

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
            name, bench_controllers[c->bench.controller], unit, unit_name,
            real(t[0], c->steps_per_unit), real(t[1], min), real(t[2], max), real(t[3], c->speed),
            real(t[4], c->acceleration));
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

static void instruments(FILE *out, const struct sim_config *c, const struct benchfile_links *links)
{
    char t[3][32];
    fprintf(out,
            "laser: { driver = \"cobolt-05\"; link = \"%s\"; power_w = %s; warmup_s = %s; "
            "polarisation = \"u\"; };\n",
            links->laser, real(t[0], c->power_w), real(t[1], c->bench.world.laser.warmup_s));
    fprintf(out,
            "detector: { driver = \"sr830\"; link = \"%s\"; time_constant_s = %s; slope_db = %d; "
            "monitor_aux = 1; u_linearity_rel = 0.0; };\n",
            links->detector, real(t[0], c->time_constant_s), c->slope_db);
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
    axis(out, c, 3, "sample", "mm", 0, 30, 0, "");
    fprintf(out, ");\n");
    instruments(out, c, links);
    fprintf(out,
            "stations: (\n"
            "  { name = \"beam\"; theta_i_deg = 0.0; theta_r_deg = 180.0; sample_mm = 30.0; },\n"
            "  { name = \"park\"; theta_i_deg = 0.0; theta_r_deg = 0.0; sample_mm = 0.0; }\n);\n");
}
