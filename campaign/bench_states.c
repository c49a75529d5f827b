// SPDX-License-Identifier: MIT
#include "campaign/bench_states.h"

#include "base/options.h"
#include "campaign/bench.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

static const char *const state_names[] = {"u", "s", "p", "+45", "-45", "R", "L", NULL};

#define PART(n, member, lo, hi, def, text)                                                         \
    {                                                                                              \
        .name = n, .type = CFG_REAL, .offset = offsetof(struct bench_polarisation, member),        \
        .min = lo, .max = hi, .fallback = def, .help = text                                        \
    }
#define GROUP(n, table, text)                                                                      \
    {                                                                                              \
        .name = n, .type = CFG_GROUP, .rows = table, .fallback = "", .help = text                  \
    }
#define SIDE(n, member, text)                                                                      \
    {                                                                                              \
        .name = n, .type = CFG_GROUPS, .size = BENCH_STATES, .stride = sizeof(struct bench_state), \
        .offset = offsetof(struct bench_polarisation, member.state),                               \
        .count_offset = offsetof(struct bench_polarisation, member.count), .rows = state_rows,     \
        .fallback = "", .help = text                                                               \
    }

static const struct cfg_row position_rows[] = {{.name = "name",
                                                .type = CFG_STRING,
                                                .offset = offsetof(struct bench_position, name),
                                                .size = BENCH_STATE_NAME,
                                                .help = "The name of one of the axes."},
                                               {.name = "at",
                                                .type = CFG_REAL,
                                                .offset = offsetof(struct bench_position, at),
                                                .min = -1e4,
                                                .max = 1e4,
                                                .help = "Where it stands, in that axis's unit."},
                                               {0}};

static const struct cfg_row state_rows[] = {
    {.name = "is",
     .type = CFG_CHOICE,
     .offset = offsetof(struct bench_state, is),
     .choices = state_names,
     .help = "Which state it is."},
    {.name = "axes",
     .type = CFG_GROUPS,
     .offset = offsetof(struct bench_state, axes),
     .size = BENCH_STATE_AXES,
     .stride = sizeof(struct bench_position),
     .count_offset = offsetof(struct bench_state, axes_count),
     .rows = position_rows,
     .help = "Where the elements of this side stand; each state places the same axes."},
    {0}};

static const struct cfg_row polariser_rows[] = {
    PART("extinction", polariser_extinction, 0, 0.5, "0",
         "At most this part of crossed light comes through, over what comes through of parallel."),
    {0}};

static const struct cfg_row analyser_rows[] = {
    PART("transmission", transmission, 0.01, 1, "1",
         "For light along its axis; readings behind it are divided by it."),
    PART("u_transmission", u_transmission, 0, 0.5, "0", "Its standard uncertainty."),
    PART("extinction", extinction, 0, 0.5, "0", "As the polariser's."),
    {0}};

const struct cfg_row bench_polarisation_rows[] = {
    SIDE("pol_in", pol_in,
         "States of the light on the sample. A polariser's angle counts from s towards +45."),
    SIDE("pol_out", pol_out, "States before the detector; \"u\" is the analyser out of the beam."),
    GROUP("polariser", polariser_rows, "What polarises the light."),
    GROUP("analyser", analyser_rows, "What analyses it."),
    {0}};

// --- checks across settings ----------------------------------------------------------------------

struct side {
    const char *name;
    const struct bench_states *states;
};

// An element of polarisation is on none of the axes that make the directions.
static bool makes_directions(const struct bench_config *b, const char *axis)
{
    struct kinematics k;
    return !strcmp(axis, "sample") ||
           (bench_kinematics(b, &k, NULL) >= 0 && kinematics_steers(&k, bench_axis_index(b, axis)));
}

static const struct bench_position *placed(const struct bench_state *s, const char *axis)
{
    for (int i = 0; i < s->axes_count; i++)
        if (!strcmp(s->axes[i].name, axis))
            return &s->axes[i];
    return NULL;
}

static int check_axis(struct cfg_file *f, const struct bench_config *b, const char *path,
                      const struct bench_position *p)
{
    char where[100];
    const struct bench_axis *a = bench_find_axis(b, p->name);
    snprintf(where, sizeof where, "%.80s.name", path);
    if (!a) {
        const char *names[BENCH_AXES + 1] = {NULL};
        for (int i = 0; i < b->axes_count; i++)
            names[i] = b->axes[i].name;
        const char *meant = options_suggest(p->name, names);
        return cfg_complain(f, where, "no axis of that name in axes%s%s%s",
                            meant ? "; did you mean '" : "", meant ? meant : "", meant ? "'?" : "");
    }
    if (makes_directions(b, p->name))
        return cfg_complain(f, where, "moves with the directions; name an element's axis");
    if (p->at >= a->min && p->at <= a->max)
        return 0;
    snprintf(where, sizeof where, "%.80s.at", path);
    return cfg_complain(f, where, "beyond the limits of axis %s; allowed %.9g..%.9g %s", a->name,
                        a->min, a->max, a->unit_name);
}

// Against the first state of its side: both place the same axes.
static int check_same_axes(struct cfg_file *f, const char *path, const struct bench_state *s,
                           const struct bench_state *first)
{
    int mistakes = 0;
    for (int i = 0; i < first->axes_count; i++)
        if (!placed(s, first->axes[i].name))
            mistakes += cfg_complain(f, path,
                                     "does not say where axis %s stands, as state \"%s\" "
                                     "of this side does",
                                     first->axes[i].name, state_names[first->is]);
    for (int i = 0; i < s->axes_count; i++)
        if (!placed(first, s->axes[i].name))
            mistakes += cfg_complain(f, path,
                                     "places axis %s, and state \"%s\" of this side does "
                                     "not say where that stands",
                                     s->axes[i].name, state_names[first->is]);
    return mistakes;
}

static int check_state(struct cfg_file *f, const struct bench_config *b, const struct side *side,
                       int i)
{
    const struct bench_state *s = &side->states->state[i];
    char path[80], where[80];
    int mistakes = 0;
    snprintf(path, sizeof path, "polarisation.%s[%d].is", side->name, i);
    for (int j = 0; j < i; j++)
        if (side->states->state[j].is == s->is)
            mistakes += cfg_complain(f, path, "is there already, in %s[%d]", side->name, j);
    for (int k = 0; k < s->axes_count; k++) {
        snprintf(path, sizeof path, "polarisation.%s[%d].axes[%d]", side->name, i, k);
        mistakes += check_axis(f, b, path, &s->axes[k]);
        snprintf(where, sizeof where, "polarisation.%s[%d].axes[%d].name", side->name, i, k);
        if (placed(s, s->axes[k].name) != &s->axes[k])
            mistakes += cfg_complain(f, where, "is placed twice in one state");
    }
    snprintf(path, sizeof path, "polarisation.%s[%d].axes", side->name, i);
    return mistakes + check_same_axes(f, path, s, &side->states->state[0]);
}

static bool belongs(const struct bench_states *s, const char *axis)
{
    return s->count && placed(&s->state[0], axis);
}

// A station would move an element away from the state that is measured there.
static int check_stations(struct cfg_file *f, const struct bench_config *b)
{
    char path[80];
    int mistakes = 0;
    for (int i = 0; i < b->stations_count; i++)
        for (int k = 0; k < b->stations[i].marks_count; k++) {
            const char *axis = b->stations[i].marks[k].name;
            snprintf(path, sizeof path, "stations[%d].axes[%d].name", i, k);
            if (belongs(&b->polarisation.pol_in, axis) || belongs(&b->polarisation.pol_out, axis))
                mistakes += cfg_complain(f, path,
                                         "stands as the states of polarisation say, not "
                                         "where a station does");
        }
    return mistakes;
}

int bench_states_check(struct cfg_file *f, const struct bench_config *b)
{
    const struct bench_polarisation *p = &b->polarisation;
    const struct side sides[] = {{"pol_in", &p->pol_in}, {"pol_out", &p->pol_out}};
    int mistakes = check_stations(f, b);
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < sides[i].states->count; k++)
            mistakes += check_state(f, b, &sides[i], k);
    for (int k = 0; p->pol_out.count && k < p->pol_out.state[0].axes_count; k++) {
        const char *axis = p->pol_out.state[0].axes[k].name;
        if (belongs(&p->pol_in, axis))
            mistakes +=
                cfg_complain(f, "polarisation.pol_out", "axis %s belongs to pol_in already", axis);
    }
    return mistakes;
}

// --- another day ---------------------------------------------------------------------------------

static bool same_places(const struct bench_state *a, const struct bench_state *b)
{
    bool same = b && a->axes_count == b->axes_count;
    for (int i = 0; same && i < a->axes_count; i++) {
        const struct bench_position *p = placed(b, a->axes[i].name);
        same = p && p->at == a->axes[i].at;
    }
    return same;
}

// The state that differs; NULL: none.
static const struct bench_state *other_state(const struct bench_states *then,
                                             const struct bench_states *now)
{
    for (int i = 0; i < then->count; i++)
        if (!same_places(&then->state[i], bench_find_state(now, then->state[i].is)))
            return &then->state[i];
    return NULL;
}

int bench_same_states(const struct bench_polarisation *then, const struct bench_polarisation *now,
                      struct gon_error *err)
{
    const struct bench_state *in = other_state(&then->pol_in, &now->pol_in);
    const struct bench_state *s = in ? in : other_state(&then->pol_out, &now->pol_out);
    if (s)
        return gon_fail(err, GON_E_REFUSED,
                        "the campaign was begun with %s \"%s\" elsewhere on the bench, or there is "
                        "no such state now; go on with that bench",
                        in ? "pol_in" : "pol_out", state_names[s->is]);
    if (then->transmission != now->transmission)
        return gon_fail(err, GON_E_REFUSED,
                        "the campaign was begun with an analyser that passes %g, the bench's "
                        "passes %g; go on with that bench",
                        then->transmission, now->transmission);
    return GON_OK;
}

const struct bench_state *bench_find_state(const struct bench_states *s, int is)
{
    for (int i = 0; i < s->count; i++)
        if (s->state[i].is == is)
            return &s->state[i];
    return NULL;
}
