// SPDX-License-Identifier: MIT
#include "cli/fitview.h"

#include "cli/out.h"
#include "fit/fit.h"

#include <jansson.h>
#include <math.h>
#include <string.h>

static double number(const json_t *o, const char *key)
{
    const json_t *v = json_object_get(o, key);
    return json_is_number(v) ? json_number_value(v) : (double)NAN;
}

// With two digits of the uncertainty on a terminal; all digits in a pipe.
static void cell(struct table *t, double value, double u)
{
    if (!isfinite(value))
        table_cell(t, "%s", out_is_terminal(stdout) ? "-" : "");
    else if (!out_is_terminal(stdout))
        table_cell(t, "%.9g", value);
    else if (isfinite(u) && u > 0 && u < 1e4 && u > 1e-9)
        table_cell(t, "%.*f", (int)fmax(0.0, 1.0 - floor(log10(u))), value);
    else
        table_cell(t, "%.5g", value);
}

static void parameter(struct table *t, const json_t *params, const char *name)
{
    const json_t *p = json_object_get(params, name);
    double u = number(p, "u");
    bool at_bound = json_is_true(json_object_get(p, "at_bound"));
    bool identified = json_is_true(json_object_get(p, "identified"));
    bool held = at_bound && u == 0; // equal bounds
    table_cell(t, "%s", name);
    cell(t, number(p, "value"), u);
    cell(t, u, u);
    cell(t, number(p, "lo95"), u);
    cell(t, number(p, "hi95"), u);
    table_cell(t, "%s", held         ? "held by its bounds"
                        : at_bound   ? "at its bound, not identified"
                        : identified ? ""
                                     : "not identified");
}

static void derived(struct table *t, const json_t *all, const char *key, const char *name,
                    const char *note)
{
    const json_t *d = json_object_get(all, key);
    double u = number(d, "u");
    table_cell(t, "%s", name);
    cell(t, number(d, "value"), u);
    cell(t, u, u);
    table_cell(t, "%s", "");
    table_cell(t, "%s", "");
    table_cell(t, "%s", note);
}

static void plain(struct table *t, const char *name, double value)
{
    table_cell(t, "%s", name);
    cell(t, value, (double)NAN);
    for (int i = 0; i < 4; i++)
        table_cell(t, "%s", "");
}

static void text_row(struct table *t, const char *name, const char *text)
{
    table_cell(t, "%s", name);
    for (int i = 0; i < 4; i++)
        table_cell(t, "%s", "");
    table_cell(t, "%s", text);
}

static void repeated(struct table *t, const json_t *all, const char *key, const char *name,
                     const char *note)
{
    const json_t *s = json_object_get(all, key);
    double u = number(s, "u");
    table_cell(t, "%s", name);
    table_cell(t, "%s", "");
    cell(t, u, u);
    cell(t, number(s, "lo95"), u);
    cell(t, number(s, "hi95"), u);
    table_cell(t, "%s", note);
}

static void bootstrap_rows(struct table *t, const json_t *b)
{
    static const char *const names[] = {"n", "k", "sigma", "ks", "kd"};
    char note[80], name[40];
    if (!b)
        return;
    if (!(number(b, "replicas") > 0)) {
        text_row(t, "bootstrap", "none: nothing tells the noise of so few readings");
        return;
    }
    snprintf(note, sizeof note, "of %.0f replicas, %s noise", number(b, "replicas"),
             json_string_value(json_object_get(b, "noise")));
    for (int i = 0; i < 5; i++) {
        snprintf(name, sizeof name, "%s, bootstrap", names[i]);
        repeated(t, json_object_get(b, "params"), names[i], name, i == 0 ? note : "");
    }
    repeated(t, json_object_get(b, "derived"), "ks_r0", "ks*R(0), bootstrap", "");
    repeated(t, json_object_get(b, "derived"), "ks_r45", "ks*R(45), bootstrap", "");
}

static void hold_out_row(struct table *t, const json_t *h)
{
    char text[200], rms[60];
    if (!h)
        return;
    fit_percent_text(number(h, "rms_relative"), rms, sizeof rms);
    int length = snprintf(text, sizeof text, "Delta %.3g, rms of residual/model %s",
                          number(h, "delta"), rms);
    if (isfinite(number(h, "chi2_per_point")))
        snprintf(text + length, sizeof text - (size_t)length, ", chi2/point %.3g",
                 number(h, "chi2_per_point"));
    text_row(t, "held out", text);
}

static void advice_row(struct table *t, const json_t *advice)
{
    const json_t *best = json_array_get(advice, 0);
    char text[400];
    if (!(number(best, "gain") > FIT_LEAST_GAIN)) // as for the warning
        return;
    snprintf(text, sizeof text, "%s", json_string_value(json_object_get(best, "text")));
    text_row(t, "helps most", text);
}

void fitview_print(const json_t *fit)
{
    static const char *const names[] = {"n", "k", "sigma", "ks", "kd"};
    const json_t *params = json_object_get(fit, "params"), *more = json_object_get(fit, "derived");
    struct table *t = table_new(6);
    for (const char *const *h =
             (const char *const[]){"parameter", "value", "u", "lo95", "hi95", "note", NULL};
         *h; h++)
        table_cell(t, "%s", *h);
    for (int i = 1; i < 5; i++)
        table_right(t, i);
    for (int i = 0; i < 5; i++)
        parameter(t, params, names[i]);
    derived(t, more, "ks_r0", "ks*R(0)", "specular strength at normal incidence");
    derived(t, more, "ks_r45", "ks*R(45)", "at 45 deg");
    derived(t, more, "dhr_0", "DHR(0)", "directional-hemispherical reflectance");
    derived(t, more, "dhr_45", "DHR(45)", "");
    derived(t, more, "dhr_60", "DHR(60)", "");
    plain(t, "Delta", number(fit, "delta"));
    if (isfinite(number(fit, "chi2_per_dof")))
        plain(t, "chi2/dof", number(fit, "chi2_per_dof"));
    if (isfinite(number(fit, "residual_lag1")))
        plain(t, "lag-1 r", number(fit, "residual_lag1"));
    bootstrap_rows(t, json_object_get(fit, "bootstrap"));
    hold_out_row(t, json_object_get(fit, "hold_out"));
    advice_row(t, json_object_get(fit, "advice"));
    table_print(t, stdout);
    fflush(stdout);

    size_t i;
    const json_t *warning;
    json_array_foreach(json_object_get(fit, "warnings"), i, warning)
        out_warn("%s", json_string_value(warning) ? json_string_value(warning) : "");
}

static void quantity(const json_t *of, const char *key, char *text, size_t size)
{
    const json_t *q = json_object_get(of, key);
    out_value(text, size, number(q, "value"), number(q, "u"));
}

void fitview_line(const json_t *fit, char *text, unsigned long size)
{
    const json_t *params = json_object_get(fit, "params");
    char sigma[60], kd[60], r0[60];
    quantity(params, "sigma", sigma, sizeof sigma);
    quantity(params, "kd", kd, sizeof kd);
    quantity(json_object_get(fit, "derived"), "ks_r0", r0, sizeof r0);
    snprintf(text, size, "sigma %s, kd %s, ks*R(0) %s, Delta %.3g", sigma, kd, r0,
             number(fit, "delta"));
}
