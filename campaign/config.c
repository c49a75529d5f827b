// SPDX-License-Identifier: MIT
#include "campaign/config.h"

#include "base/units.h"
#include "campaign/fitjson.h"

#include <stdlib.h>
#include <string.h>

#define AT(member) offsetof(struct campaign_config, member)
#define TEXT(n, member, def, text)                                                                 \
    {                                                                                              \
        .name = n, .type = CFG_STRING, .offset = AT(member),                                       \
        .size = sizeof((struct campaign_config *)0)->member, .fallback = def, .help = text         \
    }
#define REAL(n, member, u, lo, hi, def, text)                                                      \
    {                                                                                              \
        .name = n, .type = CFG_REAL, .offset = AT(member), .unit = u, .min = lo, .max = hi,        \
        .fallback = def, .help = text                                                              \
    }
#define WHOLE(n, member, lo, hi, def, text)                                                        \
    {                                                                                              \
        .name = n, .type = CFG_INT, .offset = AT(member), .min = lo, .max = hi, .fallback = def,   \
        .help = text                                                                               \
    }
#define CHOICE(n, member, list, def, text)                                                         \
    {                                                                                              \
        .name = n, .type = CFG_CHOICE, .offset = AT(member), .choices = list, .fallback = def,     \
        .help = text                                                                               \
    }
#define CHOICES(n, member, list, def, text)                                                        \
    {                                                                                              \
        .name = n, .type = CFG_CHOICES, .offset = AT(member), .size = CAMPAIGN_STATES,             \
        .count_offset = AT(member##_count), .choices = list, .fallback = def, .help = text         \
    }
// Groups of the file that are no structs of their own: offset 0.
#define GROUP(n, table, def, text)                                                                 \
    {                                                                                              \
        .name = n, .type = CFG_GROUP, .rows = table, .fallback = def, .help = text                 \
    }

static const char *const pol_in_names[] = {"u", "s", "p", "+45", "-45", "R", "L", "laser", NULL};
static const char *const pol_out_names[] = {"u", "s", "p", "+45", "-45", "R", "L", NULL};
static const char *const combine_names[] = {"each", "pairs", NULL};

static const struct cfg_row theta_r_rows[] = {
    REAL("from_deg", from_deg, "deg", -89, 89, "-85",
         "The lowest theta_r; negative is the back side."),
    REAL("to_deg", to_deg, "deg", -89, 89, "85", "The highest theta_r."),
    REAL("step_deg", step_deg, "deg", 0.01, 60, "2.5",
         "Of the coarse grid, counted from from_deg."),
    {0}};

static const struct cfg_row dense_rows[] = {
    REAL("half_width_deg", dense_half_width_deg, "deg", 0, 90, "5",
         "The dense zone is |theta_r - theta_i| up to this, its edges included; 0: no dense zone."),
    REAL("step_deg", dense_step_deg, "deg", 0.01, 60, "0.5",
         "Of the dense grid, counted from theta_i."),
    REAL("weight", dense_weight, NULL, 0.01, 10000, "3",
         "Weight g of the dense zone in the fit, against 1 elsewhere; with fit.weights = "
         "\"dense\"."),
    {0}};

static const struct cfg_row readings_rows[] = {
    WHOLE("count", readings, 1, 1000, "4", "Samples averaged at a point on the sample."), {0}};
static const struct cfg_row beam_rows[] = {
    WHOLE("count", beam_readings, 1, 1000, "16", "Samples averaged in the beam, before and after."),
    {0}};
static const struct cfg_row dark_rows[] = {
    WHOLE("count", dark_readings, 1, 1000, "16",
          "Samples averaged with the laser off, before and after."),
    {0}};

static const struct cfg_row step_rows[] = {
    {.name = "before_sweep",
     .type = CFG_INT,
     .offset = offsetof(struct campaign_step, before_sweep),
     .min = 0,
     .max = CAMPAIGN_ANGLES + 1,
     .help = "Which sweep it comes before, counted from 1; 0: before everything, also the dark; one "
             "more than there are sweeps: before the closing references."},
    {.name = "text",
     .type = CFG_STRING,
     .offset = offsetof(struct campaign_step, text),
     .size = CAMPAIGN_STEP,
     .help = "What is to be done: \"turn the sample by 90 deg\"."},
    {0}};

static const struct cfg_row fit_rows[] = {
    CHOICE("method", fit.method, fit_method_names, "\"memetic\"",
           "The search; \"paper\" is the published algorithm."),
    CHOICE("weights", fit.weighting, fit_weighting_names, "\"variance\"",
           "What a point counts in the objective."),
    CHOICE("diffuse", fit.diffuse, fit_diffuse_names, "\"paper\"",
           "The diffuse part: kd/cos theta_i or kd/pi."),
    WHOLE("seed", fit.seed, 0, 2147483647, "1", "The same seed gives the same result."),
    REAL("theta_i_max_deg", fit.theta_i_max_deg, "deg", 0, 85, "85",
         "Sweeps beyond it are not fitted."),
    {0}};

static const struct cfg_row campaign_rows[] = {
    TEXT("name", name, NULL, "What the campaign is called."),
    TEXT("sample", sample, "", "What is measured."),
    TEXT("operator", operator_name, "", "Who measures."),
    TEXT("notes", notes, "", "Anything worth keeping with the data."),
    {.name = "theta_i_deg",
     .type = CFG_REALS,
     .offset = AT(theta_i_deg),
     .size = CAMPAIGN_ANGLES,
     .count_offset = AT(theta_i_count),
     .unit = "deg",
     .min = 0,
     .max = 85,
     .help = "Angles of incidence, one sweep each, in this order; all different."},
    GROUP("theta_r", theta_r_rows, "",
          "The coarse grid of directions, signed: positive is the forward side."),
    GROUP("dense", dense_rows, "", "Finer steps around the specular direction."),
    REAL("phi_deg", phi_deg, "deg", -360, 360, "0",
         "How the sample was mounted; recorded, nothing moves."),
    CHOICES("pol_in", pol_in, pol_in_names, "\"laser\"",
            "Polarisation on the sample; \"laser\" takes what the bench says of its laser. Of "
            "several every sweep is measured in each."),
    CHOICES("pol_out", pol_out, pol_out_names, "\"u\"",
            "Analyser before the detector; \"u\": none."),
    CHOICE("pol_combine", pol_combine, combine_names, "\"each\"",
           "Of lists: \"each\" pol_in with each pol_out, or \"pairs\" of the first two, the "
           "second two and so on."),
    REAL("blind_half_deg", blind_half_deg, "deg", 0, 30, "0",
         "Skip |theta_r + theta_i| below this, where the detector stands in the beam; 0: skip "
         "nothing."),
    {.name = "steps",
     .type = CFG_GROUPS,
     .offset = AT(steps),
     .size = CAMPAIGN_STEPS,
     .stride = sizeof(struct campaign_step),
     .count_offset = AT(steps_count),
     .rows = step_rows,
     .fallback = "",
     .help = "What a person does before a sweep: the run waits, laser off, for gonio ack."},
    GROUP("readings", readings_rows, "", "On the sample."),
    GROUP("beam", beam_rows, "", "In the beam."),
    GROUP("dark", dark_rows, "", "With the laser off."),
    GROUP("fit", fit_rows, "", "After each sweep."),
    {0}};

const struct cfg_row campaign_config_schema[] = {
    GROUP("campaign", campaign_rows, NULL, "What to measure."), {0}};

int campaign_channels(const struct campaign_config *c,
                      struct campaign_channel ret_channels[CAMPAIGN_CHANNELS])
{
    int n = 0;
    for (int i = 0; i < c->pol_in_count; i++)
        for (int k = 0; k < c->pol_out_count && n < CAMPAIGN_CHANNELS; k++)
            if (c->pol_combine == CAMPAIGN_EACH || i == k)
                ret_channels[n++] = (struct campaign_channel){c->pol_in[i], c->pol_out[k]};
    return n;
}

static int check_list(struct cfg_file *f, const char *name, const int *list, int count)
{
    char path[40];
    int mistakes = 0;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < i; k++)
            if (list[i] == list[k]) {
                snprintf(path, sizeof path, "campaign.%s[%d]", name, i);
                mistakes += cfg_complain(f, path, "is there already; each state once");
                break;
            }
    return mistakes;
}

static int check_pairs(struct cfg_file *f, const struct campaign_config *c)
{
    char path[40];
    int mistakes = 0;
    if (c->pol_in_count != c->pol_out_count)
        return cfg_complain(f, "campaign.pol_combine",
                            "pol_in has %d and pol_out %d; for pairs as many of each",
                            c->pol_in_count, c->pol_out_count);
    for (int i = 0; i < c->pol_in_count; i++)
        for (int k = 0; k < i; k++)
            if (c->pol_in[i] == c->pol_in[k] && c->pol_out[i] == c->pol_out[k]) {
                snprintf(path, sizeof path, "campaign.pol_in[%d]", i);
                mistakes += cfg_complain(f, path,
                                         "with its pol_out is there already; each pair "
                                         "once");
                break;
            }
    return mistakes;
}

static int check_polarisation(struct cfg_file *f, const struct campaign_config *c)
{
    if (c->pol_combine == CAMPAIGN_PAIRS)
        return check_pairs(f, c);
    return check_list(f, "pol_in", c->pol_in, c->pol_in_count) +
           check_list(f, "pol_out", c->pol_out, c->pol_out_count);
}

static int check_steps(struct cfg_file *f, const struct campaign_config *c)
{
    char path[50];
    int mistakes = 0;
    for (int i = 0; i < c->steps_count; i++) {
        snprintf(path, sizeof path, "campaign.steps[%d].before_sweep", i);
        if (c->steps[i].before_sweep > c->theta_i_count + 1)
            mistakes += cfg_complain(f, path, "there are %d sweeps; allowed 0..%d",
                                     c->theta_i_count, c->theta_i_count + 1);
        for (int k = 0; k < i; k++)
            if (c->steps[i].before_sweep == c->steps[k].before_sweep) {
                mistakes += cfg_complain(f, path, "has a step already; say both in one text");
                break;
            }
        snprintf(path, sizeof path, "campaign.steps[%d].text", i);
        if (!*c->steps[i].text)
            mistakes += cfg_complain(f, path, "empty; say what is to be done");
    }
    return mistakes;
}

static int check(struct cfg_file *f, const struct campaign_config *c)
{
    int mistakes = check_polarisation(f, c) + check_steps(f, c);
    if (!(c->from_deg < c->to_deg))
        mistakes +=
            cfg_complain(f, "campaign.theta_r.from_deg", "not below to_deg = %.9g deg", c->to_deg);
    if (c->dense_half_width_deg > 0 && c->dense_step_deg > c->step_deg)
        mistakes += cfg_complain(f, "campaign.dense.step_deg",
                                 "coarser than theta_r.step_deg = %.9g deg", c->step_deg);
    if (!*c->name)
        mistakes += cfg_complain(f, "campaign.name", "empty; give the campaign a name");
    for (int i = 0; i < c->theta_i_count; i++)
        for (int j = 0; j < i; j++)
            if (units_udeg(c->theta_i_deg[i]) == units_udeg(c->theta_i_deg[j])) {
                char path[40];
                snprintf(path, sizeof path, "campaign.theta_i_deg[%d]", i);
                mistakes += cfg_complain(f, path, "is there already; each angle of incidence once");
                break;
            }
    return mistakes;
}

static int take(struct cfg_file *f, struct campaign_config *ret_config, char **ret_text)
{
    struct campaign_config c;
    memset(&c, 0, sizeof c);
    if (!f || cfg_take(f, campaign_config_schema, &c) || check(f, &c))
        return GON_E_INPUT;
    if (ret_text && !(*ret_text = strdup(cfg_text(f))))
        return GON_E_SYSTEM;
    *ret_config = c;
    return GON_OK;
}

int campaign_config_load(const char *path, struct cfg_sink sink, struct campaign_config *ret_config,
                         char **ret_text)
{
    struct cfg_file *f = cfg_open(path, sink);
    int rc = take(f, ret_config, ret_text);
    cfg_close(f);
    return rc;
}

int campaign_config_parse(const char *text, const char *name, struct cfg_sink sink,
                          struct campaign_config *ret_config)
{
    struct cfg_file *f = cfg_parse(text, name, sink);
    int rc = take(f, ret_config, NULL);
    cfg_close(f);
    return rc;
}

struct fit_options campaign_fit_options(const struct campaign_config *c)
{
    const double edge_deg = 0.01;
    struct fit_options o = fit_options_default();
    o.method = (enum fit_method)c->fit.method;
    o.weighting = (enum fit_weighting)c->fit.weighting;
    o.diffuse = (enum brdf_diffuse)c->fit.diffuse;
    o.seed = (uint64_t)c->fit.seed;
    o.dense_g = c->dense_weight;
    o.dense_half_width_rad = units_rad(c->dense_half_width_deg + edge_deg);
    return o;
}
