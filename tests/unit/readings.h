// SPDX-License-Identifier: MIT
// Readings for the tests of fit/: from a golden table, or made by the model with the paper's
// sampling.
#pragma once
#include "fit/fit.h"
#include "fit/rng.h"
#include "tests/unit/golden.h"

struct readings {
    size_t count;
    double *ti, *tr, *dphi, *f, *u; // radians, sr^-1
};

static inline struct readings readings_new(size_t room)
{
    double *memory = calloc(5 * room + 1, sizeof *memory);
    return (struct readings){0, memory, memory + room, memory + 2 * room, memory + 3 * room,
                             memory + 4 * room};
}

static inline void readings_free(struct readings *r)
{
    free(r->ti);
}

static inline void readings_add(struct readings *r, double theta_i_deg, double theta_r_signed_deg,
                                double f)
{
    r->ti[r->count] = golden_rad(theta_i_deg);
    r->tr[r->count] = golden_rad(fabs(theta_r_signed_deg));
    r->dphi[r->count] = theta_r_signed_deg >= 0 ? 3.14159265358979323846 : 0;
    r->f[r->count++] = f;
}

static inline struct fit_data readings_data(const struct readings *r, bool with_u)
{
    return (struct fit_data){.count = r->count,
                             .theta_i_rad = r->ti,
                             .theta_r_rad = r->tr,
                             .dphi_rad = r->dphi,
                             .f_per_sr = r->f,
                             .u_per_sr = with_u ? r->u : NULL};
}

// Positive values of `column` at theta_i up to theta_i_max_deg; false when the file is absent.
static inline bool readings_load(struct readings *ret, const char *path, const char *column,
                                 double theta_i_max_deg)
{
    struct golden t;
    if (!golden_open(&t, path))
        return false;
    *ret = readings_new((size_t)t.rows);
    for (int i = 0; i < t.rows; i++) {
        double f = golden_at(&t, i, column), ti = golden_at(&t, i, "theta_i_deg");
        if (f > 0 && ti <= theta_i_max_deg)
            readings_add(ret, ti, golden_at(&t, i, "theta_r_signed_deg"), f);
    }
    golden_close(&t);
    return true;
}

static inline double readings_model(const struct readings *r, const struct brdf_params *p, size_t i)
{
    struct brdf_geometry g = brdf_geometry(r->ti[i], r->tr[i], r->dphi[i]);
    return brdf_f00(p, BRDF_DIFFUSE_PAPER, &g);
}

// The paper's ten sweeps, every 2.5 deg and 1 deg within 5 deg of specular, exact backscatter left
// out.
static inline struct readings readings_paper(void)
{
    static const double sweep[] = {0, 5, 10, 20, 30, 40, 45, 50, 55, 60};
    struct readings r = readings_new(2000);
    for (int s = 0; s < 10; s++)
        for (int i = -850; i <= 850; i += 5) {
            double tr = i / 10.0;
            bool dense = fabs(tr - sweep[s]) <= 5 && i % 10 == 0;
            if (tr != -sweep[s] && (i % 25 == 0 || dense))
                readings_add(&r, sweep[s], tr, 0);
        }
    return r;
}

// f = model times (1 + rel_noise z) + floor z', and u to match.
static inline void readings_measure(struct readings *r, const struct brdf_params *p,
                                    double rel_noise, double floor, uint64_t seed)
{
    struct rng rng;
    rng_seed(&rng, seed);
    for (size_t i = 0; i < r->count; i++) {
        double f = readings_model(r, p, i);
        r->u[i] = hypot(rel_noise * f, floor);
        r->f[i] = f * (1 + rel_noise * rng_normal(&rng)) + floor * rng_normal(&rng);
    }
}
