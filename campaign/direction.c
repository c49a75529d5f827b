// SPDX-License-Identifier: MIT
#include "campaign/direction.h"

#include <math.h>

int direction_find(const struct csv *c, struct direction_columns *ret_columns,
                   struct gon_error *err)
{
    struct direction_columns k = {-1, -1, -1, -1};
    const bool is_signed =
        csv_column(c, "theta_r_signed_deg") != -1 || csv_column(c, "theta_r_deg") == -1;
    int rc = csv_need(c, "theta_i_deg", &k.theta_i, err);
    if (rc >= 0 && is_signed)
        rc = csv_need(c, "theta_r_signed_deg", &k.theta_r_signed, err);
    if (rc >= 0 && !is_signed)
        rc = csv_need(c, "theta_r_deg", &k.theta_r, err);
    if (rc >= 0 && !is_signed)
        rc = csv_need(c, "dphi_deg", &k.dphi, err);
    if (rc >= 0)
        *ret_columns = k;
    return rc;
}

static int take_angle(const struct csv *c, int column, double least_deg, double *ret_deg,
                      struct gon_error *err)
{
    double deg;
    int rc = csv_real(c, column, &deg, err);
    if (rc < 0)
        return rc;
    if (!(deg >= least_deg && deg > -90 && deg < 90))
        return csv_fail(c, column, err, "out of range; allowed %s deg",
                        least_deg < 0 ? "-90..90 (both excluded)" : "0..90 (90 excluded)");
    *ret_deg = deg;
    return GON_OK;
}

int direction_take(const struct csv *c, const struct direction_columns *columns,
                   struct direction *ret_direction, struct gon_error *err)
{
    struct direction d = {0, 0, 0};
    double signed_deg = 0;
    int rc = take_angle(c, columns->theta_i, 0, &d.theta_i_deg, err);
    if (rc >= 0 && columns->theta_r_signed >= 0) {
        rc = take_angle(c, columns->theta_r_signed, -90, &signed_deg, err);
        d = direction_in_plane(d.theta_i_deg, signed_deg);
    } else if (rc >= 0) {
        rc = take_angle(c, columns->theta_r, 0, &d.theta_r_deg, err);
        rc = rc < 0 ? rc : csv_real(c, columns->dphi, &d.dphi_deg, err);
    }
    if (rc >= 0)
        *ret_direction = d;
    return rc;
}

struct direction direction_in_plane(double theta_i_deg, double theta_r_signed_deg)
{
    return (struct direction){.theta_i_deg = theta_i_deg,
                              .theta_r_deg = fabs(theta_r_signed_deg),
                              .dphi_deg = theta_r_signed_deg >= 0 ? 180 : 0};
}
