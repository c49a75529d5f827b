// SPDX-License-Identifier: MIT
// In the facet's own frame the surface's Jones matrix is diag(rs, rp), and its Mueller matrix has
// two blocks: ((|rs|^2 + |rp|^2)/2, (|rs|^2 - |rp|^2)/2) in S0 and S1, (Re, Im; -Im, Re) of
// rs rp* in S2 and S3. What remains is to bring both states into that frame.
#include "model/channel.h"

// The field (s, p) becomes (s cos alpha + p sin alpha, s sin alpha - p cos alpha): this turns the
// frame and changes its hand, on both sides alike, so that the facet does not notice.
static struct brdf_stokes facet_frame(double cos_alpha, double sin_alpha, struct brdf_stokes x)
{
    const double cos_2 = brdf_cos_twice(cos_alpha, sin_alpha);
    const double sin_2 = 2 * cos_alpha * sin_alpha;
    return (struct brdf_stokes){
        {x.s[0], cos_2 * x.s[1] + sin_2 * x.s[2], sin_2 * x.s[1] - cos_2 * x.s[2], -x.s[3]}};
}

struct brdf_channel brdf_channel(const struct brdf_geometry *geometry, enum brdf_state in,
                                 enum brdf_state out)
{
    const struct brdf_rotation *r = &geometry->rotation;
    const struct brdf_stokes g = facet_frame(r->cos_i, r->sin_i, brdf_state_stokes(in));
    const struct brdf_stokes a = facet_frame(r->cos_r, r->sin_r, brdf_state_analyser(out));
    return (struct brdf_channel){
        .w_ss = (a.s[0] + a.s[1]) * (g.s[0] + g.s[1]) / 2,
        .w_pp = (a.s[0] - a.s[1]) * (g.s[0] - g.s[1]) / 2,
        .w_re = a.s[2] * g.s[2] + a.s[3] * g.s[3],
        .w_im = a.s[2] * g.s[3] - a.s[3] * g.s[2],
        .w_kd = a.s[0] * g.s[0],
    };
}
