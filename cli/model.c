// SPDX-License-Identifier: MIT
// model: the model's sixteen numbers for each row of a CSV. Works without the daemon. The rows are
// read twice: all are checked before the first is printed, so that a mistake leaves no half table.
#include "base/units.h"
#include "campaign/csv.h"
#include "campaign/direction.h"
#include "cli/fit_options.h"
#include "cli/number.h"
#include "cli/out.h"
#include "cli/verb.h"
#include "model/brdf.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PARAMS = 5, COLUMNS_MOST = 4, LONGEST_NAME = 24 };

struct options {
    struct brdf_params given; // NAN: not given
    const char *diffuse;
    bool json;
};

static const struct option_row rows[] = {
    {"--n", OPTION_REAL, offsetof(struct options, given.n), "N", 0, 0,
     "refractive index, instead of a column n"},
    {"--k", OPTION_REAL, offsetof(struct options, given.k), "K", 0, 0, "extinction coefficient"},
    {"--sigma", OPTION_REAL, offsetof(struct options, given.sigma), "SIGMA", 0, 0,
     "rms slope per axis"},
    {"--ks", OPTION_REAL, offsetof(struct options, given.ks), "KS", 0, 0, "specular strength"},
    {"--kd", OPTION_REAL, offsetof(struct options, given.kd), "KD", 0, 0, "diffuse strength"},
    {"--diffuse", OPTION_TEXT, offsetof(struct options, diffuse), "D", 0, 0,
     "paper: kd/cos(theta_i), or lambert: kd/pi (paper)"},
    {"--json", OPTION_FLAG, offsetof(struct options, json), NULL, 0, 0,
     "print {\"diffuse\", \"rows\": [{\"theta_i_deg\", ..., \"f00\", ..., \"f33\"}, ...]}"},
    VERB_OPTIONS_END,
};

// --- parameters ----------------------------------------------------------------------------------

static const struct parameter {
    const char *option, *name;
    size_t offset; // in struct brdf_params
    double least, most;
    const char *allowed;
} parameters[PARAMS] = {
    {"--n", "n", offsetof(struct brdf_params, n), 5e-324, BRDF_INDEX_MAX, "0..1e50 (0 excluded)"},
    {"--k", "k", offsetof(struct brdf_params, k), 0, BRDF_INDEX_MAX, "0..1e50"},
    {"--sigma", "sigma", offsetof(struct brdf_params, sigma), BRDF_SIGMA_MIN, BRDF_SIGMA_MAX,
     "1e-50..1e50"},
    {"--ks", "ks", offsetof(struct brdf_params, ks), 0, BRDF_STRENGTH_MAX, "0..1e50"},
    {"--kd", "kd", offsetof(struct brdf_params, kd), 0, BRDF_STRENGTH_MAX, "0..1e50"},
};

static double *member(struct brdf_params *p, const struct parameter *which)
{
    return (double *)((char *)p + which->offset);
}

static bool is_allowed(const struct parameter *which, double value)
{
    return value >= which->least && value <= which->most;
}

// Where a row's numbers come from: a column, or for a parameter the option.
struct source {
    struct csv *csv;
    int id; // column, -1: none
    struct direction_columns direction;
    int param[PARAMS]; // column, -1: the option
    struct brdf_params given;
};

// An option goes before a column of its name.
static int find_param(struct source *s, int i, struct gon_error *err)
{
    const struct parameter *which = &parameters[i];
    const double given = *member(&s->given, which);
    s->param[i] = -1;
    if (!isnan(given))
        return is_allowed(which, given)
                   ? GON_OK
                   : gon_fail(err, GON_E_INPUT, "%s %g is out of range; allowed %s", which->option,
                              given, which->allowed);
    const int rc = csv_need(s->csv, which->name, &s->param[i], err);
    if (rc < 0) {
        const size_t used = strlen(err->text);
        snprintf(err->text + used, sizeof err->text - used, "; or give %s", which->option);
    }
    return rc;
}

static int find_columns(struct source *s, struct gon_error *err)
{
    int rc = direction_find(s->csv, &s->direction, err);
    s->id = csv_column(s->csv, "id");
    if (rc >= 0 && s->id == -2)
        rc = csv_no_column(s->csv, "id", err);
    for (int i = 0; i < PARAMS && rc >= 0; i++)
        rc = find_param(s, i, err);
    return rc;
}

static int take_params(const struct source *s, struct brdf_params *ret_params,
                       struct gon_error *err)
{
    *ret_params = s->given;
    for (int i = 0; i < PARAMS; i++) {
        double value;
        if (s->param[i] < 0)
            continue;
        int rc = csv_real(s->csv, s->param[i], &value, err);
        if (rc >= 0 && !is_allowed(&parameters[i], value))
            rc = csv_fail(s->csv, s->param[i], err, "out of range; allowed %s",
                          parameters[i].allowed);
        if (rc < 0)
            return rc;
        *member(ret_params, &parameters[i]) = value;
    }
    return GON_OK;
}

// --- printing ------------------------------------------------------------------------------------

struct column {
    const char *name;
    int column;
};

// The columns that go from the input to the output.
static int echoed(const struct source *s, struct column ret[COLUMNS_MOST])
{
    const struct direction_columns *d = &s->direction;
    const struct column all[] = {{"id", s->id},
                                 {"theta_i_deg", d->theta_i},
                                 {"theta_r_signed_deg", d->theta_r_signed},
                                 {"theta_r_deg", d->theta_r},
                                 {"dphi_deg", d->dphi}};
    int count = 0;
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (all[i].column >= 0)
            ret[count++] = all[i];
    return count;
}

static void print_header(const struct source *s)
{
    struct column columns[COLUMNS_MOST];
    const int count = echoed(s, columns);
    for (int i = 0; i < count; i++)
        printf("%s,", columns[i].name);
    for (int j = 0; j < 16; j++)
        printf("f%d%d%s", j / 4, j % 4, j < 15 ? "," : "\n");
}

// Zero has no sign here: -0 is a rotation's, and means nothing.
static size_t write_value(char *text, double f)
{
    return number_write(text, f == 0 ? 0 : f);
}

static void print_csv_row(const struct source *s, const struct brdf_mueller *f)
{
    struct column columns[COLUMNS_MOST];
    char line[16 * (NUMBER_SIZE + 1)];
    const int count = echoed(s, columns);
    size_t size = 0;
    for (int i = 0; i < count; i++) {
        const struct csv_field t = csv_text(s->csv, columns[i].column);
        const char *quote = memchr(t.text, ',', t.size) ? "\"" : "";
        printf("%s%.*s%s,", quote, (int)t.size, t.text, quote);
    }
    for (int j = 0; j < 16; j++) {
        size += write_value(line + size, f->m[j / 4][j % 4]);
        line[size++] = j < 15 ? ',' : '\n';
    }
    fwrite(line, 1, size, stdout);
}

static void print_json_id(const struct source *s)
{
    const struct csv_field t = csv_text(s->csv, s->id);
    json_t *text = json_stringn(t.text, t.size); // NULL: not UTF-8
    printf("\"id\": ");
    json_dumpf(text ? text : json_null(), stdout, JSON_ENCODE_ANY);
    printf(", ");
    json_decref(text);
}

static void print_json_number(const char *name, double value)
{
    char text[NUMBER_SIZE];
    const int size = (int)write_value(text, value);
    printf("\"%s\": %.*s", name, size, text);
}

static void print_json_row(const struct source *s, const struct direction *d,
                           const struct brdf_mueller *f)
{
    const bool in_plane = s->direction.theta_r_signed >= 0;
    printf("{");
    if (s->id >= 0)
        print_json_id(s);
    print_json_number("theta_i_deg", d->theta_i_deg);
    printf(", ");
    print_json_number(in_plane ? "theta_r_signed_deg" : "theta_r_deg",
                      in_plane && d->dphi_deg == 0 ? -d->theta_r_deg : d->theta_r_deg);
    if (!in_plane) {
        printf(", ");
        print_json_number("dphi_deg", d->dphi_deg);
    }
    for (int j = 0; j < 16; j++) {
        const char name[] = {'f', (char)('0' + j / 4), (char)('0' + j % 4), 0};
        printf(", ");
        print_json_number(name, f->m[j / 4][j % 4]);
    }
    printf("}");
}

static struct brdf_mueller matrix(const struct direction *d, const struct brdf_params *p,
                                  enum brdf_diffuse diffuse)
{
    // Whole turns are taken off in degrees, where that is exact.
    const struct brdf_geometry g =
        brdf_geometry(units_rad(d->theta_i_deg), units_rad(d->theta_r_deg),
                      units_rad(remainder(d->dphi_deg, 360)));
    return brdf_mueller(p, diffuse, &g);
}

static int take_row(const struct source *s, struct direction *ret_direction,
                    struct brdf_params *ret_params, struct gon_error *err)
{
    int rc = direction_take(s->csv, &s->direction, ret_direction, err);
    return rc < 0 ? rc : take_params(s, ret_params, err);
}

static int check_rows(struct source *s, struct gon_error *err)
{
    int rc;
    while ((rc = csv_next(s->csv, err)) == 1) {
        struct direction d;
        struct brdf_params p;
        rc = take_row(s, &d, &p, err);
        if (rc < 0)
            break;
    }
    return rc;
}

static void print_rows(struct source *s, enum brdf_diffuse diffuse, bool json)
{
    struct direction d;
    struct brdf_params p;
    csv_rewind(s->csv);
    for (bool first = true; csv_next(s->csv, NULL) == 1; first = false) {
        take_row(s, &d, &p, NULL);
        const struct brdf_mueller f = matrix(&d, &p, diffuse);
        if (json) {
            fputs(first ? "\n    " : ",\n    ", stdout);
            print_json_row(s, &d, &f);
        } else {
            print_csv_row(s, &f);
        }
    }
}

static void print(struct source *s, enum brdf_diffuse diffuse, bool json)
{
    if (!json)
        print_header(s);
    else
        printf("{\n  \"diffuse\": \"%s\",\n  \"rows\": [",
               diffuse == BRDF_DIFFUSE_PAPER ? "paper" : "lambert");
    print_rows(s, diffuse, json);
    if (json)
        puts("\n  ]\n}");
}

static int run_model(const struct verb *verb, int argc, char **argv)
{
    const double nan = (double)NAN;
    struct options o = {.given = {nan, nan, nan, nan, nan}};
    struct fit_options words = fit_options_default();
    struct source s = {.csv = NULL};
    struct gon_error err;
    const char *file;
    if (verb_take(verb, argc, argv, &o, &file, 1, 1) < 0)
        return EXIT_INPUT;
    s.given = o.given;
    int rc = fit_words_take(&(struct fit_words){.diffuse = o.diffuse}, &words, &err);
    rc = rc < 0 ? rc : csv_open(file, &s.csv, &err);
    rc = rc < 0 ? rc : find_columns(&s, &err);
    rc = rc < 0 ? rc : check_rows(&s, &err);
    if (rc >= 0)
        print(&s, words.diffuse, o.json);
    csv_close(s.csv);
    return rc < 0 ? out_fail(&err) : EXIT_OK;
}

const struct verb verb_model = {
    "model",
    "FILE.csv",
    "the Mueller BRDF of the model for each row of a CSV",
    "FILE.csv (-: standard input) has the columns theta_i_deg, theta_r_deg and dphi_deg (180: the "
    "specular half\n"
    "plane), or theta_i_deg and theta_r_signed_deg, and the parameters n, k, sigma, ks, kd, as "
    "columns or as\n"
    "options; an option goes before a column. Other columns are ignored. Prints as CSV the id, if "
    "there is one,\n"
    "the angles, and f00, f01, ..., f33 in sr^-1 with 17 significant digits, in the order of the "
    "input.\n",
    rows,
    run_model};
