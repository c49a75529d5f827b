// SPDX-License-Identifier: MIT
#include "cli/fit_options.h"

#include "base/options.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

static int choose(const char *option, const char *word, const char *const *words,
                  struct gon_error *err)
{
    char all[200] = "";
    for (int i = 0; words[i]; i++) {
        if (!strcmp(word, words[i]))
            return i;
        snprintf(all + strlen(all), sizeof all - strlen(all), "%s%s", i ? ", " : "", words[i]);
    }
    const char *meant = options_suggest(word, words);
    if (meant)
        return gon_fail(err, GON_E_INPUT, "%s '%s': did you mean '%s'? allowed: %s", option, word,
                        meant, all);
    return gon_fail(err, GON_E_INPUT, "%s '%s': allowed: %s", option, word, all);
}

// As a person writes it: no exponent below 1e15, "1e50" above, no zeros at the end.
static const char *plain(double x, char text[40])
{
    if (!(fabs(x) < 1e15)) {
        snprintf(text, 40, "%g", x);
        char *plus = strchr(text, '+');
        if (plus)
            memmove(plus, plus + 1, strlen(plus));
        return text;
    }
    snprintf(text, 40, "%.9f", x);
    if (strchr(text, '.')) {
        size_t length = strlen(text);
        while (text[length - 1] == '0')
            length--;
        text[length - (text[length - 1] == '.')] = 0;
    }
    return text;
}

static int take_weights(const char *word, struct fit_options *o, struct gon_error *err)
{
    static const char *const words[] = {"uniform", "dense:G", "relative", "variance", NULL};
    double g;
    char most[40];
    if (!strncmp(word, "dense:", 6)) {
        if (options_real(word + 6, &g) < 0 || g <= 0 || g > FIT_DENSE_MOST)
            return gon_fail(err, GON_E_INPUT,
                            "--weights dense:G needs a number > 0 after the colon, not '%s'; at "
                            "most %s",
                            word + 6, plain(FIT_DENSE_MOST, most));
        o->weighting = FIT_DENSE;
        o->dense_g = g;
        return GON_OK;
    }
    int i = choose("--weights", word, words, err);
    if (i == 1)
        return gon_fail(err, GON_E_INPUT,
                        "--weights dense:G needs a number in the place of G, for example dense:3");
    if (i >= 0)
        o->weighting = (enum fit_weighting)i;
    return i < 0 ? i : GON_OK;
}

static double *bound_of(struct brdf_params *p, int param)
{
    double *const members[FIT_PARAMS] = {&p->n, &p->k, &p->sigma, &p->ks, &p->kd};
    return members[param];
}

static int find_param(const char *name)
{
    int p = 0;
    while (p < FIT_PARAMS && strcmp(name, fit_param_name((enum fit_param)p)) != 0)
        p++;
    return p;
}

// low_text, high_text: as they were typed.
static int check_bound(enum fit_param p, double low, double high, const char *low_text,
                       const char *high_text, struct gon_error *err)
{
    double least, most;
    char from[40], to[40];
    fit_param_range(p, &least, &most);
    if (low > high)
        return gon_fail(err, GON_E_INPUT,
                        "--bounds %s: %s:%s is empty; low must not be above high (equal: held)",
                        fit_param_name(p), low_text, high_text);
    if (low < least || high > most)
        return gon_fail(err, GON_E_INPUT, "--bounds %s: %s:%s is out of range; allowed %s..%s",
                        fit_param_name(p), low_text, high_text, plain(least, from),
                        plain(most, to));
    return GON_OK;
}

// One "name=low:high"; the text is changed. given: bits of the parameters that were there before.
static int take_bound(char *text, unsigned *given, struct fit_options *o, struct gon_error *err)
{
    char *equals = strchr(text, '='), *colon = equals ? strchr(equals, ':') : NULL;
    double low, high;
    if (!colon)
        return gon_fail(err, GON_E_INPUT, "--bounds '%s' is not NAME=LOW:HIGH, for example n=1:3",
                        text);
    *equals = *colon = 0;
    const int p = find_param(text);
    if (p == FIT_PARAMS)
        return gon_fail(err, GON_E_INPUT,
                        "--bounds: no parameter '%s'; allowed: n, k, sigma, ks, kd", text);
    if (options_real(equals + 1, &low) < 0 || options_real(colon + 1, &high) < 0)
        return gon_fail(err, GON_E_INPUT, "--bounds %s: '%s:%s' are not two numbers", text,
                        equals + 1, colon + 1);
    if (*given >> p & 1)
        return gon_fail(err, GON_E_INPUT, "--bounds: %s is given twice", text);
    *given |= 1u << p;
    int rc = check_bound((enum fit_param)p, low, high, equals + 1, colon + 1, err);
    if (rc == 0) {
        *bound_of(&o->lower, p) = low;
        *bound_of(&o->upper, p) = high;
    }
    return rc;
}

static int take_bounds(const char *text, struct fit_options *o, struct gon_error *err)
{
    char copy[400];
    unsigned given = 0;
    if (strlen(text) >= sizeof copy)
        return gon_fail(err, GON_E_INPUT, "--bounds is longer than %zu characters",
                        sizeof copy - 1);
    strcpy(copy, text);
    for (char *part = copy, *end; part; part = end ? end + 1 : NULL) {
        end = strchr(part, ',');
        if (end)
            *end = 0;
        int rc = take_bound(part, &given, o, err);
        if (rc < 0)
            return rc;
    }
    return GON_OK;
}

int fit_words_take(const struct fit_words *words, struct fit_options *options,
                   struct gon_error *err)
{
    static const char *const methods[] = {"memetic", "paper", NULL}, *const diffuses[] = {
                                                                         "paper", "lambert", NULL};
    struct fit_options o = *options;
    int rc = GON_OK;
    if (words->method && (rc = choose("--method", words->method, methods, err)) >= 0)
        o.method = (enum fit_method)rc;
    if (rc >= 0 && words->diffuse && (rc = choose("--diffuse", words->diffuse, diffuses, err)) >= 0)
        o.diffuse = (enum brdf_diffuse)rc;
    if (rc >= 0 && words->weights)
        rc = take_weights(words->weights, &o, err);
    if (rc >= 0 && words->bounds)
        rc = take_bounds(words->bounds, &o, err);
    if (rc < 0)
        return rc;
    *options = o;
    return GON_OK;
}

static bool paper_given(const struct fit_paper_words *w)
{
    return w->population || w->bits || w->generations || w->mutation || w->scaling || w->elitism;
}

int fit_paper_take(const struct fit_paper_words *w, struct fit_options *options,
                   struct gon_error *err)
{
    static const char *const mutations[] = {"bit", "individual", NULL},
                             *const scalings[] = {"none", "linear", NULL};
    struct fit_paper_options p = options->paper;
    int rc = GON_OK;
    if (paper_given(w) && options->method != FIT_PAPER)
        return gon_fail(err, GON_E_INPUT,
                        "--population, --bits, --generations, --mutation, --scaling and --elitism "
                        "belong to --method paper");
    if (w->population % 2)
        return gon_fail(err, GON_E_INPUT, "--population %ld: individuals breed in pairs; an even "
                        "number of 4..10000", w->population);
    p.population = w->population ? (int)w->population : p.population;
    p.bits = w->bits ? (int)w->bits : p.bits;
    p.generations = w->generations ? (int)w->generations : p.generations;
    p.elitism = w->elitism || p.elitism;
    if (w->mutation && (rc = choose("--mutation", w->mutation, mutations, err)) >= 0)
        p.mutation = (enum fit_mutation)rc;
    if (rc >= 0 && w->scaling && (rc = choose("--scaling", w->scaling, scalings, err)) >= 0)
        p.scaling = (enum fit_scaling)rc;
    if (rc < 0)
        return rc;
    options->paper = p;
    return GON_OK;
}

int fit_bootstrap_take(long replicas, struct fit_options *options, struct gon_error *err)
{
    if (replicas != 0 && (replicas < FIT_LEAST_REPLICAS || replicas > FIT_MOST_REPLICAS))
        return gon_fail(err, GON_E_INPUT,
                        "--bootstrap %ld is out of range; allowed 0, or %d..%d (a 95 %% interval "
                        "needs one replica beyond each end)",
                        replicas, FIT_LEAST_REPLICAS, FIT_MOST_REPLICAS);
    options->bootstrap = (int)replicas;
    return GON_OK;
}

int fit_angles_take(const char *option, const char *text, double *ret_deg, int most,
                    struct gon_error *err)
{
    char copy[1000];
    double deg[FIT_MOST_ANGLES];
    int count = 0;
    if (strlen(text) >= sizeof copy)
        return gon_fail(err, GON_E_INPUT, "%s is longer than %zu characters", option,
                        sizeof copy - 1);
    strcpy(copy, text);
    for (char *part = copy, *end; part; part = end ? end + 1 : NULL) {
        end = strchr(part, ',');
        if (end)
            *end = 0;
        if (count == most || count == FIT_MOST_ANGLES)
            return gon_fail(err, GON_E_INPUT, "%s '%.60s': at most %d angles", option, text, most);
        if (options_real(part, &deg[count]) < 0 || deg[count] < 0 || deg[count] >= 90)
            return gon_fail(err, GON_E_INPUT,
                            "%s '%s' is not an angle of 0..90 deg (90 excluded); give a list: "
                            "0,10,20",
                            option, part);
        count++;
    }
    memcpy(ret_deg, deg, (size_t)count * sizeof *deg);
    return count;
}
