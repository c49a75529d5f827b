// SPDX-License-Identifier: MIT
#define BATCH batch_passes_plain
#include "model/batch_pass.h"

void batch_fresnel(const struct batch_point *p, double cos2_beta, double ret_f[3])
{
    double cos_beta[VEC_LANES], f[3][VEC_LANES];
    vec_store(cos_beta, vec_all(sqrt(cos2_beta)));
    struct slope s = mean_slope(p, facet_at(cos_beta));
    vec_store(f[0], s.f);
    vec_store(f[1], s.n);
    vec_store(f[2], s.k);
    for (int i = 0; i < 3; i++)
        ret_f[i] = f[i][0];
}
