// SPDX-License-Identifier: MIT
#include "campaign/dataset.h"

#include "base/units.h"
#include "campaign/csv.h"
#include "campaign/direction.h"
#include "campaign/reduce.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SAME_ANGLE_DEG 1e-6

struct dataset_filter dataset_filter_all(void)
{
    return (struct dataset_filter){.theta_i_max_deg = (double)INFINITY};
}

static bool among(const double *list_deg, int count, double theta_i_deg)
{
    bool found = false;
    for (int i = 0; i < count; i++)
        found = found || fabs(list_deg[i] - theta_i_deg) <= SAME_ANGLE_DEG;
    return found;
}

static bool passes(const struct dataset_filter *f, double theta_i_deg)
{
    return (f->theta_i_count == 0 || among(f->theta_i_deg, f->theta_i_count, theta_i_deg)) &&
           !among(f->without_deg, f->without_count, theta_i_deg) &&
           theta_i_deg <= f->theta_i_max_deg + SAME_ANGLE_DEG;
}

void dataset_clear(struct dataset *d)
{
    if (!d)
        return;
    free(d->theta_i_rad);
    free(d->theta_r_rad);
    free(d->dphi_rad);
    free(d->f_per_sr);
    free(d->u_per_sr);
    *d = (struct dataset){0};
}

struct fit_data dataset_fit_data(const struct dataset *d)
{
    return (struct fit_data){.count = d->count,
                             .theta_i_rad = d->theta_i_rad,
                             .theta_r_rad = d->theta_r_rad,
                             .dphi_rad = d->dphi_rad,
                             .f_per_sr = d->f_per_sr,
                             .u_per_sr = d->u_per_sr};
}

// --- one row at a time
// -------------------------------------------------------------------------------

struct row {
    struct direction direction;
    double f, u; // u NAN: none
};

static bool grow(double **list, size_t room)
{
    double *larger = realloc(*list, room * sizeof *larger);
    *list = larger ? larger : *list;
    return larger;
}

static int add(struct dataset *d, size_t *room, const struct row *r, struct gon_error *err)
{
    if (d->count == *room) {
        size_t more = *room ? 2 * *room : 1024;
        if (!grow(&d->theta_i_rad, more) || !grow(&d->theta_r_rad, more) ||
            !grow(&d->dphi_rad, more) || !grow(&d->f_per_sr, more) || !grow(&d->u_per_sr, more))
            return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", d->source);
        *room = more;
    }
    d->theta_i_rad[d->count] = units_rad(r->direction.theta_i_deg);
    d->theta_r_rad[d->count] = units_rad(r->direction.theta_r_deg);
    d->dphi_rad[d->count] = units_rad(r->direction.dphi_deg);
    d->f_per_sr[d->count] = r->f;
    d->u_per_sr[d->count++] = r->u;
    return GON_OK;
}

// What must hold for all rows together; without an uncertainty in each row there is none.
static int finish(struct dataset *d, const char *column, struct gon_error *err)
{
    bool all_u = true, all_zero = true;
    for (size_t i = 0; i < d->count; i++) {
        all_u = all_u && d->u_per_sr[i] > 0;
        all_zero = all_zero && d->f_per_sr[i] == 0;
    }
    if (d->count == 0)
        return d->left_out ? gon_fail(err, GON_E_INPUT,
                                      "%s: no row is left: the choice of theta_i excludes all %zu",
                                      d->source, d->left_out)
                           : gon_fail(err, GON_E_INPUT, "%s: no data", d->source);
    if (all_zero)
        return gon_fail(err, GON_E_INPUT, "%s: %s is zero in all %zu rows", d->source, column,
                        d->count);
    if (!all_u) {
        free(d->u_per_sr);
        d->u_per_sr = NULL;
    }
    return GON_OK;
}

// --- CSV
// ---------------------------------------------------------------------------------------------

struct columns {
    struct direction_columns direction;
    int value, u, pol_in, pol_out; // -1: not there
};

// u_NAME belongs to column NAME; u_f_r also to another column when there is no f_r.
static int find_u(const struct csv *c, const char *column)
{
    char name[200];
    snprintf(name, sizeof name, "u_%s", column);
    int u = csv_column(c, name);
    return u == -1 && csv_column(c, "f_r") == -1 ? csv_column(c, "u_f_r") : u;
}

static int find_columns(const struct csv *c, const char *column, struct columns *k,
                        struct gon_error *err)
{
    int rc = direction_find(c, &k->direction, err);
    if (rc >= 0)
        rc = csv_need(c, column, &k->value, err);
    k->u = find_u(c, column);
    k->pol_in = csv_column(c, "pol_in");
    k->pol_out = csv_column(c, "pol_out");
    return rc;
}

static int check_unpolarised(const struct csv *c, int column, struct gon_error *err)
{
    if (column < 0)
        return GON_OK;
    const struct csv_field f = csv_text(c, column);
    if (f.size == 1 && *f.text == 'u')
        return GON_OK;
    return csv_fail(c, column, err,
                    "only unpolarised data (u) can be fitted so far; leave the other rows out");
}

static int take_row(const struct csv *c, const struct columns *k, struct row *r,
                    struct gon_error *err)
{
    int rc = direction_take(c, &k->direction, &r->direction, err);
    if (rc >= 0)
        rc = csv_real(c, k->value, &r->f, err);
    r->u = (double)NAN;
    if (rc >= 0 && k->u >= 0)
        rc = csv_real(c, k->u, &r->u, err);
    if (rc >= 0 && k->u >= 0 && !(r->u > 0))
        rc = csv_fail(c, k->u, err, "a standard uncertainty is above zero");
    if (rc >= 0)
        rc = check_unpolarised(c, k->pol_in, err);
    return rc >= 0 ? check_unpolarised(c, k->pol_out, err) : rc;
}

static int take_rows(struct csv *c, const char *column, const struct dataset_filter *filter,
                     struct dataset *d, struct gon_error *err)
{
    struct columns k;
    size_t room = 0;
    int rc = find_columns(c, column, &k, err);
    while (rc >= 0 && (rc = csv_next(c, err)) == 1) {
        struct row r;
        rc = take_row(c, &k, &r, err);
        if (rc < 0)
            return rc;
        if (passes(filter, r.direction.theta_i_deg))
            rc = add(d, &room, &r, err);
        else
            d->left_out++;
    }
    return rc >= 0 ? finish(d, column, err) : rc;
}

int dataset_from_csv(const char *path, const char *column, const struct dataset_filter *filter,
                     struct dataset *ret_data, struct gon_error *err)
{
    struct dataset d = {0};
    struct csv *c;
    int rc = csv_open(path, &c, err);
    if (rc < 0)
        return rc;
    snprintf(d.source, sizeof d.source, "%s", path);
    rc = take_rows(c, column ? column : "f_r", filter, &d, err);
    csv_close(c);
    if (rc < 0)
        dataset_clear(&d);
    else
        *ret_data = d;
    return rc;
}

// --- campaign files
// ----------------------------------------------------------------------------------

// The encoder may say -0.0003 deg for 0: the same geometry with both signs turned round.
static struct row row_of(const struct reduced_point *p)
{
    const double theta_r_deg = p->theta_i_deg < 0 ? -p->theta_r_deg : p->theta_r_deg;
    return (struct row){.direction = direction_in_plane(fabs(p->theta_i_deg), theta_r_deg),
                        .f = p->f_per_sr,
                        .u = p->u_a_per_sr};
}

static int take_points(const struct plan *plan, const struct reduction *r,
                       const struct dataset_filter *filter, struct dataset *d,
                       struct gon_error *err)
{
    size_t room = 0;
    int rc = GON_OK;
    for (int i = 0, k = 0; k < r->count && rc >= 0; i++) {
        const struct reduced_point *p = &r->points[k];
        if (plan->points[i].sweep != p->sweep || plan->points[i].point != p->point)
            continue;
        const struct row row = row_of(p);
        if (passes(filter, plan->points[i].theta_i_deg))
            rc = add(d, &room, &row, err);
        else
            d->left_out++;
        k++;
    }
    d->u_scale = r->u_scale_rel;
    return rc >= 0 ? finish(d, "f_r", err) : rc;
}

static int check_analyser(struct store *s, struct gon_error *err)
{
    char *pol_out = store_read_meta(s, "pol_out");
    int rc =
        pol_out && !strcmp(pol_out, "u")
            ? GON_OK
            : gon_fail(err, GON_E_INPUT,
                       "%s: measured behind an analyser (%s); only readings without one can be "
                       "fitted so far",
                       store_path(s), pol_out ? pol_out : "?");
    free(pol_out);
    return rc;
}

int dataset_from_store(struct store *s, const struct dataset_filter *filter,
                       struct dataset *ret_data, struct reduction *ret_reduction,
                       struct gon_error *err)
{
    struct dataset d = {0};
    struct plan plan = {0};
    struct reduction r = {0};
    int rc = check_analyser(s, err);
    if (rc >= 0)
        rc = store_read_plan(s, &plan, err);
    if (rc >= 0)
        rc = reduce_campaign(s, &r, err);
    snprintf(d.source, sizeof d.source, "%s", store_path(s));
    if (rc >= 0)
        rc = take_points(&plan, &r, filter, &d, err);
    if (rc >= 0)
        reduction_warning(&r, d.note, sizeof d.note);
    plan_clear(&plan);
    if (rc < 0)
        dataset_clear(&d);
    else
        *ret_data = d;
    if (rc >= 0 && ret_reduction)
        *ret_reduction = r;
    else
        reduction_clear(&r);
    return rc;
}
