// SPDX-License-Identifier: MIT
#include "campaign/dataset.h"

#include "base/options.h"
#include "base/units.h"
#include "campaign/csv.h"
#include "campaign/direction.h"
#include "campaign/polarisation.h"
#include "campaign/reduce.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SAME_ANGLE_DEG 1e-6
#define RIGHT_ANGLE_RAD 1.6 // a little more than pi/2

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
    free(d->pol_in);
    free(d->pol_out);
    *d = (struct dataset){0};
}

struct fit_data dataset_fit_data(const struct dataset *d)
{
    return (struct fit_data){.count = d->count,
                             .theta_i_rad = d->theta_i_rad,
                             .theta_r_rad = d->theta_r_rad,
                             .dphi_rad = d->dphi_rad,
                             .f_per_sr = d->f_per_sr,
                             .u_per_sr = d->u_per_sr,
                             .pol_in = d->pol_in,
                             .pol_out = d->pol_out};
}

// --- one row at a time ---------------------------------------------------------------------------

struct row {
    struct direction direction;
    double f, u; // u NAN: none
    enum brdf_state in, out;
};

static bool grow(void *list, size_t room, size_t size)
{
    void **at = list, *larger = realloc(*at, room * size);
    *at = larger ? larger : *at;
    return larger;
}

static bool grow_all(struct dataset *d, size_t room)
{
    double **const numbers[] = {&d->theta_i_rad, &d->theta_r_rad, &d->dphi_rad, &d->f_per_sr,
                                &d->u_per_sr};
    bool ok = grow(&d->pol_in, room, 1) && grow(&d->pol_out, room, 1);
    for (int i = 0; i < 5; i++)
        ok = ok && grow(numbers[i], room, sizeof **numbers[i]);
    return ok;
}

static int add(struct dataset *d, size_t *room, const struct row *r, struct gon_error *err)
{
    if (d->count == *room) {
        size_t more = *room ? 2 * *room : 1024;
        if (!grow_all(d, more))
            return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", d->source);
        *room = more;
    }
    d->theta_i_rad[d->count] = units_rad(r->direction.theta_i_deg);
    d->theta_r_rad[d->count] = units_rad(r->direction.theta_r_deg);
    d->dphi_rad[d->count] = units_rad(r->direction.dphi_deg);
    d->f_per_sr[d->count] = r->f;
    d->pol_in[d->count] = (unsigned char)r->in;
    d->pol_out[d->count] = (unsigned char)r->out;
    d->u_per_sr[d->count++] = r->u;
    return GON_OK;
}

// What must hold for all rows together: no uncertainty unless each row has one, and states
// that are all u need no telling.
static int finish(struct dataset *d, const char *column, struct gon_error *err)
{
    bool all_u = true, all_zero = true, polarised = false;
    for (size_t i = 0; i < d->count; i++) {
        polarised = polarised || d->pol_in[i] != BRDF_STATE_U || d->pol_out[i] != BRDF_STATE_U;
        all_u = all_u && d->u_per_sr[i] > 0;
        all_zero = all_zero && d->f_per_sr[i] == 0;
    }
    if (d->count == 0)
        return d->left_out ? gon_fail(err, GON_E_INPUT,
                                      "%s: no row is left: the choice of theta_i excludes all %zu",
                                      d->source, d->left_out)
           : d->excluded ? gon_fail(err, GON_E_INPUT,
                                    "%s: no row is left: %d readings are excluded; take some back: "
                                    "gonio restore",
                                    d->source, d->excluded)
                         : gon_fail(err, GON_E_INPUT, "%s: no data", d->source);
    if (all_zero)
        return gon_fail(err, GON_E_INPUT, "%s: %s is zero in all %zu rows", d->source, column,
                        d->count);
    if (!all_u) {
        free(d->u_per_sr);
        d->u_per_sr = NULL;
    }
    if (!polarised) {
        free(d->pol_in);
        free(d->pol_out);
        d->pol_in = d->pol_out = NULL;
    }
    return GON_OK;
}

// --- CSV -----------------------------------------------------------------------------------------

struct columns {
    struct direction_columns direction;
    int value, u, pol_in, pol_out; // -1: not there
};

// -1 where there is none.
static int optional(const struct csv *c, const char *name, int *ret_column, struct gon_error *err)
{
    *ret_column = csv_column(c, name);
    return *ret_column == -2 ? csv_no_column(c, name, err) : GON_OK;
}

// u_NAME belongs to column NAME; u_f_r also to another column when there is no f_r.
static int find_u(const struct csv *c, const char *column, int *ret_u, struct gon_error *err)
{
    char name[200];
    snprintf(name, sizeof name, "u_%s", column);
    int rc = optional(c, name, ret_u, err);
    return rc >= 0 && *ret_u == -1 && csv_column(c, "f_r") == -1 ? optional(c, "u_f_r", ret_u, err)
                                                                 : rc;
}

static int find_columns(const struct csv *c, const char *column, struct columns *k,
                        struct gon_error *err)
{
    int rc = direction_find(c, &k->direction, err);
    if (rc >= 0)
        rc = column ? csv_choose(c, column, &k->value, err) : csv_need(c, "f_r", &k->value, err);
    if (rc >= 0)
        rc = find_u(c, column ? column : "f_r", &k->u, err);
    if (rc >= 0)
        rc = optional(c, "pol_in", &k->pol_in, err);
    return rc >= 0 ? optional(c, "pol_out", &k->pol_out, err) : rc;
}

// Adds a sentence if there is room for all of it.
__attribute__((format(printf, 2, 3))) static void note(struct dataset *d, const char *fmt, ...)
{
    char text[sizeof d->note];
    const size_t used = strlen(d->note);
    va_list args;
    va_start(args, fmt);
    const int length = vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    if (used + (size_t)length + 2 < sizeof d->note)
        snprintf(d->note + used, sizeof d->note - used, "%s%s", used ? " " : "", text);
}

// u_NAME beside a column NAME is that column's; another may be a misspelt uncertainty.
static bool may_be_u(const struct csv *c, const char *name)
{
    return (*name == 'u' || *name == 'U') && (name[1] != '_' || csv_column(c, name + 2) == -1);
}

// An optional column that is not there, and one that nobody reads with nearly its name.
static void note_misspelt(const struct csv *c, const struct columns *k, const char *value,
                          struct dataset *d)
{
    char u[200], shown[CSV_SHOWN];
    snprintf(u, sizeof u, "u_%s", value);
    for (const char *const *name = csv_columns(c); *name; name++) {
        const char *words[4] = {NULL};
        int count = 0;
        if (k->u < 0 && may_be_u(c, *name))
            words[count++] = u;
        if (k->pol_in < 0 && strcmp(*name, "pol_out") != 0)
            words[count++] = "pol_in";
        if (k->pol_out < 0 && strcmp(*name, "pol_in") != 0)
            words[count++] = "pol_out";
        const char *meant = strcmp(*name, value) != 0 ? options_suggest(*name, words) : NULL;
        if (meant)
            note(d, "Column '%s' is ignored; did you mean '%s'?", csv_shown(*name, 40, shown),
                 meant);
    }
}

static int take_state(const struct csv *c, int column, enum brdf_state *ret_state,
                      struct gon_error *err)
{
    char name[8], all[60] = "";
    *ret_state = BRDF_STATE_U;
    if (column < 0)
        return GON_OK;
    const struct csv_field f = csv_text(c, column);
    if (f.size == 1 && *f.text == 'u')
        return GON_OK;
    snprintf(name, sizeof name, "%.*s", f.size > 7 ? 0 : (int)f.size, f.text);
    int state = brdf_state_find(name);
    if (state >= 0) {
        *ret_state = (enum brdf_state)state;
        return GON_OK;
    }
    for (int i = 0; i < BRDF_STATES; i++)
        snprintf(all + strlen(all), sizeof all - strlen(all), "%s%s", i ? ", " : "",
                 brdf_state_name((enum brdf_state)i));
    return csv_fail(c, column, err, "no state of polarisation; allowed %s", all);
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
    if (rc >= 0 && !(fabs(r->f) <= FIT_READING_MOST))
        rc = csv_fail(c, k->value, err, "beyond what can be fitted; allowed -1e100..1e100");
    if (rc >= 0 && k->u >= 0 && r->u > FIT_READING_MOST)
        rc = csv_fail(c, k->u, err, "beyond what can be fitted; allowed up to 1e100");
    if (rc >= 0 && k->u >= 0 && !(r->u > 0))
        rc = csv_fail(c, k->u, err, "a standard uncertainty is above zero");
    if (rc >= 0)
        rc = take_state(c, k->pol_in, &r->in, err);
    return rc >= 0 ? take_state(c, k->pol_out, &r->out, err) : rc;
}

static int take_rows(struct csv *c, const char *column, const struct dataset_filter *filter,
                     struct dataset *d, struct gon_error *err)
{
    struct columns k;
    size_t room = 0;
    double largest_deg = 0;
    int rc = find_columns(c, column, &k, err);
    while (rc >= 0 && (rc = csv_next(c, err)) == 1) {
        struct row r;
        rc = take_row(c, &k, &r, err);
        if (rc < 0)
            return rc;
        largest_deg = fmax(largest_deg, fmax(r.direction.theta_i_deg, r.direction.theta_r_deg));
        if (passes(filter, r.direction.theta_i_deg))
            rc = add(d, &room, &r, err);
        else
            d->left_out++;
    }
    if (rc >= 0) {
        note_misspelt(c, &k, column ? column : "f_r", d);
        if (largest_deg > 0 && largest_deg < RIGHT_ANGLE_RAD)
            note(d, "All angles are below %g, and are read as degrees: are these radians?",
                 RIGHT_ANGLE_RAD);
    }
    return rc >= 0 ? finish(d, column ? column : "f_r", err) : rc;
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
    rc = take_rows(c, column, filter, &d, err);
    csv_close(c);
    if (rc < 0)
        dataset_clear(&d);
    else
        *ret_data = d;
    return rc;
}

// --- campaign files ------------------------------------------------------------------------------

_Static_assert((int)POL_U == (int)BRDF_STATE_U && (int)POL_L == (int)BRDF_STATE_L &&
                   (int)POL_KNOWN == (int)BRDF_STATES,
               "the states of a campaign are those of the model, and unknown");

// The encoder may say -0.0003 deg for 0: the same geometry with both signs turned round. Light of
// an unknown state is taken for unpolarised, and a note says so.
static struct row row_of(const struct reduced_point *p)
{
    const double theta_r_deg = p->theta_i_deg < 0 ? -p->theta_r_deg : p->theta_r_deg;
    const int in = p->pol_in == POL_UNKNOWN ? POL_U : p->pol_in;
    return (struct row){.direction = direction_in_plane(fabs(p->theta_i_deg), theta_r_deg),
                        .f = p->f_per_sr,
                        .u = p->u_a_per_sr,
                        .in = (enum brdf_state)in,
                        .out = (enum brdf_state)p->pol_out};
}

static int take_points(const struct plan *plan, const struct reduction *r,
                       const struct dataset_filter *filter, struct dataset *d,
                       struct gon_error *err)
{
    size_t room = 0;
    int rc = GON_OK;
    for (int k = 0; k < r->count && rc >= 0; k++) {
        const struct reduced_point *p = &r->points[k];
        const struct row row = row_of(p);
        if (p->pol_out == POL_UNKNOWN)
            rc = gon_fail(err, GON_E_INPUT, "%s: the file does not say which analyser was used",
                          d->source);
        else if (passes(filter, plan->points[p->index].theta_i_deg))
            rc = add(d, &room, &row, err);
        else
            d->left_out++;
    }
    d->u_scale = r->u_scale_rel;
    d->excluded = r->excluded;
    return rc >= 0 ? finish(d, "f_r", err) : rc;
}

int dataset_from_store(struct store *s, const struct dataset_filter *filter,
                       struct dataset *ret_data, struct reduction *ret_reduction,
                       struct gon_error *err)
{
    struct dataset d = {0};
    struct plan plan = {0};
    struct reduction r = {0};
    int rc = store_read_plan(s, &plan, err);
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
