// SPDX-License-Identifier: MIT
// The passes of model/batch.c, for the level whose file includes this and names it with BATCH.
#pragma once
#include "model/batch_level.h"
#include "model/batch_vec.h"

BATCH_INLINE void f00_any(const struct batch *b, const struct batch_point *p, double ks, double kd,
                          bool folds, double *restrict f)
{
    const vec lead = vec_all(4 * ks * p->v * p->w), diffuse = vec_all(kd);
    for (size_t i = 0; i < b->padded; i += VEC_LANES) {
        vec height = vec_load(b->spec + i) * lobe_at(p, b->tan2_theta + i);
        vec one = mean_value(p, facet_at(b->cos_beta + i), height, folds);
        vec_store(f + i, vec_fma(lead, one, diffuse * vec_load(b->diffuse + i)));
    }
}

static void f00(const struct batch *b, const struct batch_point *point, double ks, double kd,
                double *restrict f)
{
    const struct batch_point p = *point;
    if (batch_folds(&p))
        f00_any(b, &p, ks, kd, true, f);
    else
        f00_any(b, &p, ks, kd, false, f);
}

static void jacobian(const struct batch *b, const struct batch_point *point, double ks, double kd,
                     double *const column[BATCH_COLUMNS])
{
    const struct batch_point p = *point;
    double *dn = column[BATCH_DN], *dk = column[BATCH_DKAPPA], *ds = column[BATCH_DSIGMA];
    double *one = column[BATCH_DKS], *flat = column[BATCH_DKD], *f = column[BATCH_F];
    const vec strength = vec_all(ks), diffuse = vec_all(kd), v = vec_all(p.v);
    for (size_t i = 0; i < b->padded; i += VEC_LANES) {
        vec height = v * vec_load(b->spec + i) * lobe_at(&p, b->tan2_theta + i);
        struct slope s = mean_slope(&p, facet_at(b->cos_beta + i));
        vec specular = strength * height * s.f, level = vec_load(b->diffuse + i);
        vec_store(dn + i, strength * height * s.n);
        vec_store(dk + i, strength * height * s.k);
        vec_store(ds + i, specular * (2 * v * vec_load(b->tan2_theta + i) - 2));
        vec_store(one + i, height * s.f);
        vec_store(flat + i, level);
        vec_store(f + i, vec_fma(diffuse, level, specular));
    }
}

const struct batch_passes BATCH = {f00, jacobian};
