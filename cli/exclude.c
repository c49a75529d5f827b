// SPDX-License-Identifier: MIT
// exclude, restore: readings that do not count, and count again. A file in the folder of a daemon
// that runs is its to write; any other is written here, under its lock.
#include "base/paths.h"
#include "campaign/catalog.h"
#include "campaign/store_exclude.h"
#include "cli/client.h"
#include "cli/out.h"
#include "cli/remote.h"
#include "cli/verb.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define SAME_ANGLE_DEG 0.005 // as fine as anybody types one

struct options {
    struct remote_options remote;
    const char *dir, *reason, *theta_r;
    double theta_i_deg;
};

static const struct option_row rows[] = {
    {"--reason", OPTION_TEXT, offsetof(struct options, reason), "TEXT", 0, 0,
     "why; it is kept with the readings"},
    {"--theta-i", OPTION_REAL, offsetof(struct options, theta_i_deg), "DEG", 0, 90,
     "instead of READINGS: those on the sample at this nominal theta_i"},
    {"--theta-r", OPTION_TEXT, offsetof(struct options, theta_r), "FROM..TO", 0, 0,
     "instead of READINGS: those from one signed theta_r to another, or at one"},
    {"--dir", OPTION_TEXT, offsetof(struct options, dir), "DIR", 0, 0,
     "the folder of campaigns ($GONIO_DIR)"},
    REMOTE_SOCKET(struct options),
    REMOTE_JSON(struct options),
    VERB_OPTIONS_END,
};

struct task {
    const struct options *o;
    bool restore;
    char path[CATALOG_PATH];
    char *which; // readings, as campaign/reading_pick.h
};

// --- by their angles -----------------------------------------------------------------------------

static int take_range(const char *text, double *ret_from, double *ret_to, struct gon_error *err)
{
    char from[40], *dots;
    snprintf(from, sizeof from, "%s", text);
    dots = strstr(from, "..");
    if (dots)
        *dots = 0;
    if (strlen(text) < sizeof from && options_real(from, ret_from) == 0 &&
        options_real(dots ? dots + 2 : from, ret_to) == 0 && *ret_from <= *ret_to)
        return GON_OK;
    return gon_fail(err, GON_E_INPUT, "--theta-r '%s': use FROM..TO in deg, as in -5..5", text);
}

// Whether a verb has something to do there; list and *at go along with the points.
static bool has_some(const struct plan_point *p, const struct store_reading *list, int count,
                     int *at, bool restore)
{
    bool some = false;
    for (; *at < count && list[*at].sweep == p->sweep && list[*at].point == p->point; (*at)++) {
        const struct store_reading *r = &list[*at];
        const bool out = !(r->flags & STORE_REJECTING) && r->standing != STORE_COUNTS;
        some = some || (restore ? out : store_reading_counts(r));
    }
    return some;
}

static void write_picks(FILE *out, const struct plan *plan, const bool *chosen)
{
    const char *comma = "";
    for (int i = 0; i < plan->count; i++) {
        const struct plan_point *p = &plan->points[i];
        if (!chosen[i])
            continue;
        while (i + 1 < plan->count && chosen[i + 1] && plan->points[i + 1].sweep == p->sweep)
            i++;
        fprintf(out, "%s%d/%d", comma, p->sweep, p->point);
        if (plan->points[i].point > p->point)
            fprintf(out, "-%d", plan->points[i].point);
        comma = ",";
    }
}

static int choose(const struct task *t, const struct plan *plan, const struct store_reading *list,
                  int count, bool *chosen, struct gon_error *err)
{
    double from = -(double)INFINITY, to = (double)INFINITY;
    int found = 0, rc = t->o->theta_r ? take_range(t->o->theta_r, &from, &to, err) : GON_OK;
    if (rc < 0)
        return rc;
    for (int i = 0, at = 0; i < plan->count; i++) {
        const struct plan_point *p = &plan->points[i];
        const bool there = p->kind == PLAN_SAMPLE &&
                           !(fabs(p->theta_i_deg - t->o->theta_i_deg) > SAME_ANGLE_DEG) &&
                           p->theta_r_deg >= from - SAME_ANGLE_DEG &&
                           p->theta_r_deg <= to + SAME_ANGLE_DEG;
        chosen[i] = has_some(p, list, count, &at, t->restore) && there;
        found += chosen[i];
    }
    return found ? found
                 : gon_fail(err, GON_E_INPUT, "%s: no reading there %s", t->path,
                            t->restore ? "is excluded" : "counts");
}

static int pick_by_angles(struct task *t, struct gon_error *err)
{
    struct store *s = NULL;
    struct plan plan = {0};
    struct store_reading *readings = NULL;
    size_t size;
    int rc = store_open(t->path, STORE_READ, &s, err);
    rc = rc < 0 ? rc : store_read_plan(s, &plan, err);
    const int count = rc < 0 ? rc : store_read_readings(s, -1, &readings, err);
    bool *chosen = count < 0 ? NULL : calloc((size_t)plan.count + 1, sizeof *chosen);
    rc = count < 0 ? count
         : chosen  ? choose(t, &plan, readings, count, chosen, err)
                   : gon_fail(err, GON_E_SYSTEM, "out of memory");
    FILE *out = rc < 0 ? NULL : open_memstream(&t->which, &size);
    if (out) {
        write_picks(out, &plan, chosen);
        fclose(out);
    }
    free(chosen);
    free(readings);
    plan_clear(&plan);
    store_close(s, NULL);
    return rc < 0 || t->which ? rc : gon_fail(err, GON_E_SYSTEM, "out of memory");
}

// --- who writes it -------------------------------------------------------------------------------

// 1: the daemon's; 0: ours.
static int is_daemons(const struct task *t, struct client *c, struct gon_error *err)
{
    const int rc = catalog_id(t->path) ? remote_has(c, t->path, err) : 0;
    return rc == GON_E_GONE ? 0 : rc;
}

static int ask_daemon(const struct task *t, struct client *c, struct gon_error *err)
{
    char path[80];
    json_t *reply = NULL, *body = json_pack("{s:s, s:s}", "do", t->restore ? "restore" : "exclude",
                                            "readings", t->which);
    if (!body || json_object_set_new(body, "reason", json_string(t->o->reason)) < 0) {
        json_decref(body);
        return gon_fail(err, GON_E_INPUT, "readings and reason must be text (UTF-8)");
    }
    snprintf(path, sizeof path, "/api/v1/runs/%d/exclusions", catalog_id(t->path));
    int rc = client_request(c, "POST", path, body, &reply, err);
    if (rc == 0)
        rc = (int)json_integer_value(json_object_get(reply, "readings"));
    json_decref(reply);
    json_decref(body);
    return rc;
}

static int write_file(const struct task *t, struct gon_error *err)
{
    char who[65];
    struct store *s = NULL;
    struct timespec now;
    paths_person(who, sizeof who);
    if (!*who)
        snprintf(who, sizeof who, "uid %ld", (long)geteuid());
    clock_gettime(CLOCK_REALTIME, &now);
    const struct store_decision d = {(int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000,
                                     t->o->reason, who};
    int rc = store_open(t->path, STORE_WRITE, &s, err);
    if (rc >= 0 && *store_notice(s)) {
        out_say("%s: %s", t->path, store_notice(s));
        rc = store_append_event(s, d.t_utc_ms, "notice", "store", store_notice(s), err);
    }
    if (rc >= 0)
        rc = t->restore ? store_restore(s, t->which, &d, err) : store_exclude(s, t->which, &d, err);
    const int closed = store_close(s, rc < 0 ? NULL : err);
    return rc < 0 || closed >= 0 ? rc : closed;
}

static int perform(const struct task *t, struct gon_error *err)
{
    struct client *c = NULL;
    int rc = client_new(t->o->remote.socket, &c, err);
    rc = rc < 0 ? rc : is_daemons(t, c, err);
    if (rc >= 0)
        rc = rc ? ask_daemon(t, c, err) : write_file(t, err);
    client_free(c);
    return rc;
}

// --- the verbs -----------------------------------------------------------------------------------

static int check_words(const struct options *o, int count, struct gon_error *err)
{
    const bool angles = isfinite(o->theta_i_deg) || o->theta_r;
    if (!o->reason || !o->reason[strspn(o->reason, " ")])
        return gon_fail(err, GON_E_INPUT,
                        "without a reason nobody will know later why; say it with --reason TEXT");
    if (angles == (count == 2))
        return gon_fail(err, GON_E_INPUT,
                        "say which readings: either SWEEP/POINT[,...] or --theta-i and --theta-r");
    return GON_OK;
}

static int prepare(struct task *t, const char *const *operands, int count, struct gon_error *err)
{
    char directory[CATALOG_PATH];
    int rc = check_words(t->o, count, err);
    rc = rc < 0 ? rc : catalog_directory(t->o->dir, directory, sizeof directory, err);
    rc = rc < 0 ? rc : catalog_resolve(directory, operands[0], t->path, sizeof t->path, err);
    if (rc < 0 || count < 2)
        return rc < 0 ? rc : pick_by_angles(t, err);
    t->which = strdup(operands[1]);
    return t->which ? GON_OK : gon_fail(err, GON_E_SYSTEM, "out of memory");
}

static void print(const struct task *t, int readings)
{
    if (t->o->remote.json) {
        json_t *o = json_pack("{s:i, s:o, s:s, s:s, s:i}", "run", catalog_id(t->path), "file",
                              out_json_text(t->path), "do", t->restore ? "restore" : "exclude",
                              "which", t->which, "readings", readings);
        out_json(o);
        json_decref(o);
    } else {
        fprintf(stderr, "%d reading%s %s %s (%s). Fit again: gonio fit %s\n", readings,
                readings == 1 ? "" : "s",
                t->restore      ? readings == 1 ? "counts" : "count"
                : readings == 1 ? "does not count"
                                : "do not count",
                t->restore ? "again" : "any more", t->which, t->path);
    }
}

static int run_decide(const struct verb *verb, int argc, char **argv)
{
    struct options o = {.theta_i_deg = (double)NAN};
    struct task t = {.o = &o, .restore = !strcmp(verb->name, "restore")};
    struct gon_error err;
    const char *operands[2];
    const int count = verb_take(verb, argc, argv, &o, operands, 1, 2);
    if (count < 0)
        return EXIT_INPUT;
    int rc = prepare(&t, operands, count, &err);
    rc = rc < 0 ? rc : perform(&t, &err);
    if (rc >= 0)
        print(&t, rc);
    free(t.which);
    return rc < 0 ? out_fail(&err) : EXIT_OK;
}

const struct verb verb_exclude = {
    "exclude",
    "FILE [READINGS]",
    "readings that do not count, with the reason",
    "READINGS are named as gonio show FILE --sweep N numbers them: SWEEP/POINT, SWEEP/FIRST-LAST, "
    "SWEEP/POINT/ATTEMPT, or SWEEP for all of one, several with commas: 1/3,2/5-9. Sweep 0 and the "
    "last are the references. Or they are chosen by --theta-i and --theta-r.\n"
    "They stay in the file, are shown with the reason, and count neither for the reduction nor for "
    "a "
    "fit until gonio restore. Their points are not measured again: that is gonio remeasure. What "
    "was "
    "reduced and fitted before stays; gonio fit FILE uses what counts now.\n"
    "It also works while the campaign is measured, and for a FILE that no daemon has.\n",
    rows,
    run_decide};

const struct verb verb_restore = {
    "restore",
    "FILE [READINGS]",
    "excluded readings that count again",
    "READINGS as for gonio exclude. Of a point without ATTEMPT the last of its readings that do "
    "not "
    "count is taken back. Also takes back gonio remeasure, of points that are not measured yet.\n",
    rows,
    run_decide};
