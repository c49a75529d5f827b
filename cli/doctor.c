// SPDX-License-Identifier: MIT
// doctor: looks at every device of a bench and says what is wrong with it.
#include "base/clk.h"
#include "campaign/bench.h"
#include "cli/check.h"
#include "cli/client.h"
#include "cli/examine.h"
#include "cli/out.h"
#include "cli/ports.h"
#include "cli/verb.h"
#include "drivers/laser.h"

#include <jansson.h>
#include <string.h>
#include <unistd.h>

#define BENCH_FILE "goniod.cfg" // of the folder one is in, when none is named

struct options {
    const char *socket;
    bool json;
};

static const struct option_row rows[] = {
    {"--socket", OPTION_TEXT, offsetof(struct options, socket), "PATH", 0, 0,
     "of a daemon that may have the ports"},
    {"--json", OPTION_FLAG, offsetof(struct options, json), NULL, 0, 0,
     "print {\"file\", \"goniod_pid\", \"well\", \"findings\": [...]}"},
    VERB_OPTIONS_END,
};

struct doctor {
    const json_t *devices; // of a daemon that runs; NULL: none
    long pid;              // of that daemon
    json_t *findings;      // NULL: printed at once
    int wrong;
};

static const char *text_of(const json_t *o, const char *key)
{
    const char *text = json_string_value(json_object_get(o, key));
    return text ? text : "";
}

// --- what was found ------------------------------------------------------------------------------

static void print_part(const char *name, const char *text)
{
    if (*text)
        options_fill(stdout, text, printf("                      %-5s ", name));
}

static void print_row(const struct finding *f)
{
    printf("%s\t%s\t%s\t%s\t%s\n", f->who, finding_level_name(f->level), f->what, f->why, f->todo);
}

static void print_paragraph(const struct finding *f)
{
    static const enum out_style styles[] = {OUT_GREEN, OUT_YELLOW, OUT_RED};
    printf("%-15s %s%-5s%s ", f->who, out_begin(stdout, styles[f->level]),
           finding_level_name(f->level), out_end(stdout));
    options_fill(stdout, f->what, 22);
    print_part("why:", f->why);
    print_part("do:", f->todo);
}

static void print_finding(const struct finding *f)
{
    if (out_is_terminal(stdout))
        print_paragraph(f);
    else
        print_row(f);
    fflush(stdout); // the next one may take seconds
}

static void found(void *ctx, const struct finding *f)
{
    struct doctor *d = ctx;
    d->wrong += f->level == FINDING_WRONG;
    if (d->findings)
        json_array_append_new(
            d->findings,
            json_pack("{s:s, s:s, s:s, s:s, s:s}", "who", f->who, "level",
                      f->level == FINDING_WRONG ? "wrong" : finding_level_name(f->level), "what",
                      f->what, "why", f->why, "what_to_do", f->todo));
    else
        print_finding(f);
}

// --- what a daemon that has the ports says -------------------------------------------------------

static void explain_lost(struct finding *f, const char *why)
{
    explain_look(f, "%s", why);
    f->level = FINDING_WRONG;
    snprintf(f->why, sizeof f->why, "goniod cannot reach it and goes on trying");
    snprintf(f->todo, sizeof f->todo, "end goniod and ask again: doctor then looks itself");
}

static bool explain_told_laser(struct finding *f, const json_t *laser)
{
    struct laser_status s = {.interlock_closed =
                                 json_is_true(json_object_get(laser, "interlock_closed"))};
    for (enum laser_state state = LASER_OFF; state <= LASER_FAULT; state++)
        if (!strcmp(text_of(laser, "state"), laser_state_name(state)))
            s.state = state;
    s.fault_code = (int)json_integer_value(json_object_get(laser, "fault_code"));
    return explain_laser(f, &s, "see the laser's manual");
}

static void tell_device(struct doctor *d, const json_t *device)
{
    const json_t *axis = json_object_get(device, "axis"), *laser = json_object_get(device, "laser");
    struct finding f;
    if (strcmp(text_of(device, "state"), "ok"))
        explain_lost(&f, text_of(device, "why"));
    else if (json_is_true(json_object_get(laser, "off_unconfirmed")))
        explain_emission(&f);
    else if (axis && json_is_true(json_object_get(axis, "alarm")))
        explain_alarm(&f, (int)json_integer_value(json_object_get(axis, "alarm_code")), "");
    else if (axis && json_is_false(json_object_get(axis, "homed")))
        explain_home(&f);
    else if (!laser || !explain_told_laser(&f, laser))
        explain_well(&f, "%s, says goniod", text_of(device, "identity"));
    snprintf(f.who, sizeof f.who, "%s%s", axis ? "axis " : "", text_of(device, "name"));
    found(d, &f);
}

static bool held(void *ctx, const char *part, const char *link)
{
    struct doctor *d = ctx;
    const json_t *device;
    size_t i;
    json_array_foreach(d->devices, i, device)
    {
        if (strcmp(text_of(device, "link"), link) || strcmp(text_of(device, "name"), part))
            continue;
        tell_device(d, device);
        return true;
    }
    return false;
}

static void tell_daemon(struct doctor *d)
{
    struct finding f;
    explain_look(&f, "goniod is running: the ports of its bench are in use by pid %ld", d->pid);
    snprintf(f.why, sizeof f.why, "a port belongs to one program at a time");
    snprintf(f.todo, sizeof f.todo,
             "nothing: what it says of its devices follows. To let doctor look itself, end it: "
             "kill %ld (the laser goes off first)",
             d->pid);
    snprintf(f.who, sizeof f.who, "goniod");
    found(d, &f);
}

// No daemon is no mistake.
static json_t *ask_daemon(const char *socket)
{
    struct client *c = NULL;
    json_t *reply = NULL;
    struct gon_error err;
    if (client_new(socket, &c, &err) == 0)
        client_request(c, "GET", "/api/v1/devices", NULL, &reply, &err);
    client_free(c);
    return reply;
}

// --- the verb ------------------------------------------------------------------------------------

// In a pipe a table with its heading.
static void begin_report(const struct doctor *d)
{
    if (!d->findings && !out_is_terminal(stdout))
        printf("who\tlevel\twhat\twhy\twhat_to_do\n");
}

static int examine_file(struct doctor *d, const char *path)
{
    struct bench_config bench;
    if (check_bench(path, &bench) != EXIT_OK)
        return EXIT_INPUT;
    begin_report(d);
    if (d->devices)
        tell_daemon(d);
    const struct examine e = {&bench, clk_system(), PORTS_BY_ID, d, held, found};
    examine_bench(&e);
    return EXIT_OK;
}

static void tell_all(struct doctor *d)
{
    const json_t *device;
    size_t i;
    begin_report(d);
    tell_daemon(d);
    json_array_foreach(d->devices, i, device) tell_device(d, device);
}

static void report(const struct doctor *d, const char *path)
{
    if (d->findings) {
        json_t *o = json_pack("{s:s?, s:b, s:O}", "file", path, "well", d->wrong == 0, "findings",
                              d->findings);
        json_object_set_new(o, "goniod_pid", d->devices ? json_integer(d->pid) : json_null());
        out_json(o);
        json_decref(o);
    } else if (d->wrong) {
        fprintf(stderr, "%d %s wrong\n", d->wrong, d->wrong == 1 ? "thing is" : "things are");
    } else {
        fprintf(stderr, "all well\n");
    }
}

static int run_doctor(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    const char *path = NULL;
    int count = verb_take(verb, argc, argv, &o, &path, 0, 1), status = EXIT_OK;
    if (count < 0)
        return EXIT_INPUT;
    json_t *reply = ask_daemon(o.socket);
    if (count == 0 && access(BENCH_FILE, R_OK) == 0)
        path = BENCH_FILE;
    struct doctor d = {.devices = json_object_get(reply, "devices"),
                       .pid = (long)json_integer_value(json_object_get(reply, "pid")),
                       .findings = o.json ? json_array() : NULL};
    if (path) {
        status = examine_file(&d, path);
    } else if (d.devices) {
        tell_all(&d);
    } else {
        out_say("doctor: which bench? gonio doctor goniod.cfg; see: gonio help doctor");
        status = EXIT_INPUT;
    }
    if (status == EXIT_OK) {
        report(&d, path);
        status = d.wrong ? EXIT_FAILED : EXIT_OK;
    }
    json_decref(d.findings);
    json_decref(reply);
    return status;
}

const struct verb verb_doctor = {
    "doctor",
    "[BENCH.cfg]",
    "look at every device and say what is wrong and what to do",
    "Opens everything that a bench file names (goniod.cfg of this folder when none is given), asks "
    "each device who it is and how it is, and says what is wrong, why, and what to do: no such "
    "port, no permission, in use by whom, nobody answers, another device on this port, a unit's "
    "address, an alarm, no home, no reference, interlock, key. Nothing moves and nothing is "
    "switched "
    "on; a laser is told OFF before anything else. Where a goniod has the ports, what it says of "
    "its devices is told instead. Ends with status 0 when all is well and 1 when something is "
    "wrong.\n",
    rows,
    run_doctor};
