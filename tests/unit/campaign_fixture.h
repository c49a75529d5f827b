// SPDX-License-Identifier: MIT
// A bench and a campaign for the tests of campaign/, and a folder that goes away again.
#pragma once
#include "campaign/bench.h"
#include "campaign/config.h"
#include "campaign/plan.h"
#include "campaign/store.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define FIXTURE_BENCH                                                                              \
    "bench: { name = \"test bench\"; wavelength_nm = 1060.0; regime = \"underfilled\";\n"          \
    "  aperture_radius_mm = 8.0; u_aperture_radius_mm = 0.004; distance_mm = 500.0; "              \
    "u_distance_mm = 0.25; };\n"                                                                   \
    "buses: ( { name = \"axes\"; link = \"modbus-rtu:/dev/ttyUSB0?baud=115200&parity=E\"; } );\n"  \
    "axes: (\n"                                                                                    \
    "  { name = \"theta_i\"; driver = \"oriental-az\"; bus = \"axes\"; unit = 1; steps_per_unit "  \
    "= 1000.0;\n"                                                                                  \
    "    min = -5.0; max = 88.0; speed = 20.0; acceleration = 60.0; deadband = 0.003; },\n"        \
    "  { name = \"theta_r\"; driver = \"oriental-az\"; bus = \"axes\"; unit = 2; steps_per_unit "  \
    "= 1000.0;\n"                                                                                  \
    "    min = -180.0; max = 180.0; speed = 20.0; acceleration = 60.0; deadband = 0.003; } );\n"   \
    "laser: { driver = \"cobolt-05\"; link = \"serial:/dev/ttyUSB1\"; power_w = 0.05; warmup_s = " \
    "1.0;\n"                                                                                       \
    "  polarisation = \"u\"; };\n"                                                                 \
    "detector: { driver = \"sr830\"; link = \"tcp:lockin:8000\"; time_constant_s = 0.001; "        \
    "slope_db = 12;\n"                                                                             \
    "  monitor_aux = 1; };\n"                                                                      \
    "stations: ( { name = \"beam\"; theta_i_deg = 0.0; theta_r_deg = 180.0; sample_mm = 30.0; } "  \
    ");\n"

// The same with a polariser in the laser's beam and an analyser before the detector, each on an
// axis that also takes it out of the beam.
#define FIXTURE_ELEMENT(name, unit)                                                                \
    ",\n  { name = \"" name "\"; driver = \"oriental-az\"; bus = \"axes\"; unit = " unit           \
    "; steps_per_unit = 1000.0;\n"                                                                 \
    "    min = -10.0; max = 280.0; speed = 20.0; acceleration = 60.0; deadband = 0.003; }"
#define FIXTURE_STATE(is, name, at)                                                                \
    "{ is = \"" is "\"; axes = ( { name = \"" name "\"; at = " at "; } ); }"
#define FIXTURE_STATES                                                                             \
    "polarisation: {\n"                                                                            \
    "  pol_in = ( " FIXTURE_STATE(                                                                 \
        "s", "polariser",                                                                          \
        "0.0") ",\n"                                                                               \
               "    " FIXTURE_STATE(                                                               \
                   "p", "polariser",                                                               \
                   "90.0") " );\n"                                                                 \
                           "  pol_out = ( " FIXTURE_STATE(                                         \
                               "u", "analyser",                                                    \
                               "270.0") ",\n"                                                      \
                                        "    " FIXTURE_STATE(                                      \
                                            "s", "analyser",                                       \
                                            "0.0") ",\n"                                           \
                                                   "    " FIXTURE_STATE(                           \
                                                       "p", "analyser",                            \
                                                       "90.0") " );\n"                             \
                                                               "  polariser: { extinction = "      \
                                                               "0.002; };\n"                       \
                                                               "  analyser: { transmission = "     \
                                                               "0.8; u_transmission = 0.008; "     \
                                                               "extinction = 0.001; };\n};\n"

struct said {
    char text[6000];
    int lines;
};

static inline void fixture_say(void *ctx, const char *line)
{
    struct said *s = ctx;
    size_t used = strlen(s->text);
    snprintf(s->text + used, sizeof s->text - used, "%s\n", line);
    s->lines++;
}

static inline struct bench_config fixture_bench(void)
{
    struct bench_config b;
    if (bench_config_parse(FIXTURE_BENCH, "bench.cfg", (struct cfg_sink){0}, &b) < 0)
        abort();
    return b;
}

static inline char *fixture_polarised_text(char *text, size_t size)
{
    static const char end[] = " } );\nlaser"; // of the axes
    const char *at = strstr(FIXTURE_BENCH, end);
    snprintf(text, size, "%.*s }%s%s%s%s", (int)(at - FIXTURE_BENCH), FIXTURE_BENCH,
             FIXTURE_ELEMENT("polariser", "4"), FIXTURE_ELEMENT("analyser", "5"), at + 2,
             FIXTURE_STATES);
    return text;
}

static inline struct bench_config fixture_polarised_bench(void)
{
    struct bench_config b;
    struct said said = {0};
    char text[4000];
    if (bench_config_parse(fixture_polarised_text(text, sizeof text), "bench.cfg",
                           (struct cfg_sink){fixture_say, &said}, &b) < 0) {
        fputs(said.text, stderr);
        abort();
    }
    return b;
}

static inline struct campaign_config fixture_campaign(const char *text)
{
    struct campaign_config c;
    struct said said = {0};
    if (campaign_config_parse(text, "c.cfg", (struct cfg_sink){fixture_say, &said}, &c) < 0) {
        fputs(said.text, stderr);
        abort();
    }
    return c;
}

struct fixture_folder {
    char path[64];
};

static inline struct fixture_folder fixture_folder(void)
{
    struct fixture_folder f = {"/tmp/gonio-test-XXXXXX"};
    if (!mkdtemp(f.path))
        abort();
    return f;
}

static inline const char *fixture_path(const struct fixture_folder *f, const char *name, char *path,
                                       size_t size)
{
    if (snprintf(path, size, "%s/%s", f->path, name) >= (int)size)
        abort();
    return path;
}

static inline int fixture_files(const struct fixture_folder *f)
{
    int n = 0;
    DIR *d = opendir(f->path);
    for (struct dirent *e; d && (e = readdir(d));)
        n += e->d_name[0] != '.';
    if (d)
        closedir(d);
    return n;
}

static inline void fixture_remove(const struct fixture_folder *f)
{
    DIR *d = opendir(f->path);
    for (struct dirent *e; d && (e = readdir(d));)
        if (strcmp(e->d_name, ".") && strcmp(e->d_name, ".."))
            unlinkat(dirfd(d), e->d_name, 0);
    if (d)
        closedir(d);
    rmdir(f->path);
}
