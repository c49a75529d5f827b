// SPDX-License-Identifier: MIT
#include "campaign/fitjson.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>

const char *const fit_method_names[] = {"memetic", "paper", NULL};
const char *const fit_weighting_names[] = {"uniform", "dense", "relative", "variance", NULL};
const char *const fit_diffuse_names[] = {"paper", "lambert", NULL};

const char *fit_method_name(enum fit_method m)
{
    return fit_method_names[m];
}

const char *fit_weighting_name(enum fit_weighting w)
{
    return fit_weighting_names[w];
}

const char *fit_diffuse_name(enum brdf_diffuse d)
{
    return fit_diffuse_names[d];
}

static json_t *number(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

static json_t *params(const struct fit_result *r)
{
    json_t *all = json_object();
    for (int i = 0; i < FIT_PARAMS; i++) {
        const struct fit_estimate *e = &r->estimate[i];
        json_object_set_new(all, fit_param_name((enum fit_param)i),
                            json_pack("{s:o, s:o, s:o, s:o, s:b, s:b}", "value", number(e->value),
                                      "u", number(e->u), "lo95", number(e->lo95), "hi95",
                                      number(e->hi95), "identified", e->identified, "at_bound",
                                      e->at_bound));
    }
    return all;
}

static json_t *derived(const struct fit_result *r)
{
    const struct {
        const char *name;
        const struct fit_derived *d;
    } rows[] = {{"ks_r0", &r->ks_r0},
                {"ks_r45", &r->ks_r45},
                {"dhr_0", &r->dhr_0},
                {"dhr_45", &r->dhr_45},
                {"dhr_60", &r->dhr_60}};
    json_t *all = json_object();
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        json_object_set_new(
            all, rows[i].name,
            json_pack("{s:o, s:o}", "value", number(rows[i].d->value), "u", number(rows[i].d->u)));
    return all;
}

static json_t *correlation(const struct fit_result *r)
{
    json_t *all = json_array();
    for (int i = 0; i < FIT_PARAMS; i++) {
        json_t *row = json_array();
        for (int j = 0; j < FIT_PARAMS; j++)
            json_array_append_new(row, number(r->correlation[i][j]));
        json_array_append_new(all, row);
    }
    return all;
}

static json_t *spread(const struct fit_spread *s)
{
    return json_pack("{s:o, s:o, s:o}", "u", number(s->u), "lo95", number(s->lo95), "hi95",
                     number(s->hi95));
}

static json_t *bootstrap(const struct fit_bootstrap *b)
{
    json_t *all = json_object();
    for (int i = 0; i < FIT_PARAMS; i++)
        json_object_set_new(all, fit_param_name((enum fit_param)i), spread(&b->param[i]));
    return json_pack("{s:i, s:s, s:o, s:{s:o, s:o}}", "replicas", b->replicas, "noise",
                     b->parametric ? "parametric" : "wild", "params", all, "derived", "ks_r0",
                     spread(&b->ks_r0), "ks_r45", spread(&b->ks_r45));
}

static json_t *advice(const struct fit_result *r)
{
    json_t *all = json_array();
    for (int i = 0; i < r->advice_count; i++) {
        const struct fit_advice *a = &r->advice[i];
        const size_t readings = a->what == FIT_MEASURE_NOTHING ? 0 : r->advice_readings;
        json_t *u = json_object();
        char text[300];
        for (int p = 0; p < FIT_PARAMS; p++)
            json_object_set_new(u, fit_param_name((enum fit_param)p), number(a->u[p]));
        fit_advice_text(r, i, text, sizeof text);
        json_array_append_new(all, json_pack("{s:s, s:s, s:I, s:o, s:o}", "measure",
                                             fit_measurement_name(a->what), "text", text,
                                             "readings", (json_int_t)readings, "u", u, "gain",
                                             number(a->gain)));
    }
    return all;
}

static json_t *hold_out(const struct fit_hold_out *h)
{
    const struct fit_validation *v = &h->validation;
    json_t *angles = json_array();
    for (int i = 0; i < h->count; i++)
        json_array_append_new(angles, json_real(h->theta_i_deg[i]));
    return json_pack("{s:o, s:I, s:o, s:o, s:o}", "theta_i_deg", angles, "points",
                     (json_int_t)v->points, "delta", number(v->delta), "chi2_per_point",
                     number(v->chi2_per_point), "rms_relative", number(v->rms_relative));
}

static json_t *warnings(const struct fit_record *f)
{
    const struct fit_result *r = &f->result;
    json_t *all = json_array();
    for (unsigned bit = 1; bit; bit <<= 1) {
        char text[600];
        if ((r->warnings & bit) &&
            fit_warning_text(r, (enum fit_warning)bit, text, sizeof text) > 0)
            json_array_append_new(all, json_string(text));
    }
    if (*f->note)
        json_array_append_new(all, json_string(f->note));
    return all;
}

char *fit_json(const struct fit_record *f, int indent)
{
    const struct fit_result *r = &f->result;
    json_t *o = json_pack("{s:s, s:s, s:s, s:I, s:i, s:I}", "method", fit_method_name(f->options.method),
                          "weights", fit_weighting_name(f->options.weighting), "diffuse",
                          fit_diffuse_name(f->options.diffuse), "points", (json_int_t)f->points,
                          "excluded", f->excluded, "seed", (json_int_t)f->options.seed);
    if (f->sweep >= 0)
        json_object_set_new(o, "sweep", json_integer(f->sweep));
    json_object_set_new(o, "delta", number(r->delta));
    json_object_set_new(o, "params", params(r));
    json_object_set_new(o, "derived", derived(r));
    json_object_set_new(o, "correlation", correlation(r));
    json_object_set_new(o, "chi2_per_dof", number(r->chi2_per_dof));
    json_object_set_new(o, "residual_lag1", number(r->residual_lag1));
    if (f->options.bootstrap > 0)
        json_object_set_new(o, "bootstrap", bootstrap(&r->bootstrap));
    if (f->hold_out.count > 0)
        json_object_set_new(o, "hold_out", hold_out(&f->hold_out));
    json_object_set_new(o, "advice", advice(r));
    json_object_set_new(o, "evaluations", json_integer(r->evaluations));
    json_object_set_new(o, "elapsed_ms", number(r->elapsed_ms));
    json_object_set_new(o, "elapsed_total_ms", number(r->elapsed_total_ms));
    json_object_set_new(o, "warnings", warnings(f));
    char *text = o ? json_dumps(o, JSON_REAL_PRECISION(17) | JSON_INDENT((size_t)indent)) : NULL;
    json_decref(o);
    return text;
}
