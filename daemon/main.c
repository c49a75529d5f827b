// SPDX-License-Identifier: MIT
// goniod: reads its options and the bench, then runs the hub until a signal ends it.
#include "base/cfg.h"
#include "base/clk.h"
#include "base/log.h"
#include "base/options.h"
#include "base/paths.h"
#include "base/standard.h"
#include "campaign/bench.h"
#include "campaign/catalog.h"
#include "daemon/deadline.h"
#include "daemon/guardian.h"
#include "daemon/hub.h"
#include "daemon/listener.h"
#include "daemon/loop.h"
#include "daemon/profile_texts.h"
#include "daemon/service.h"
#include "daemon/simulator.h"

#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

struct options {
    const char *config, *socket, *dir, *log;
    long seed;
    bool sim, fast, help, version, options;
};

static const struct option_row rows[] = {
    {"--config", OPTION_TEXT, offsetof(struct options, config), "FILE", 0, 0,
     "the bench, for example goniod.cfg"},
    {"--sim", OPTION_FLAG, offsetof(struct options, sim), NULL, 0, 0,
     "a simulated bench instead: no hardware, no file"},
    {"--fast", OPTION_FLAG, offsetof(struct options, fast), NULL, 0, 0,
     "with --sim: quick axes and filters"},
    {"--seed", OPTION_INT, offsetof(struct options, seed), "N", 0, 4294967295.0,
     "with --sim: of its noise (7)"},
    {"--socket", OPTION_TEXT, offsetof(struct options, socket), "PATH", 0, 0,
     "where gonio finds it ($GONIO_SOCKET)"},
    {"--dir", OPTION_TEXT, offsetof(struct options, dir), "DIR", 0, 0,
     "where campaigns go ($GONIO_DIR)"},
    {"--log", OPTION_TEXT, offsetof(struct options, log), "LEVEL", 0, 0,
     "error, warning, notice, info or debug (notice)"},
    {"--help", OPTION_FLAG, offsetof(struct options, help), NULL, 0, 0, "this"},
    {"--version", OPTION_FLAG, offsetof(struct options, version), NULL, 0, 0, "the version"},
    {"--options", OPTION_FLAG, offsetof(struct options, options), NULL, 0, 0,
     "this list for the manual page"},
    {NULL, OPTION_FLAG, 0, NULL, 0, 0, NULL},
};

enum { DESCRIPTORS_LEAST = 128, DESCRIPTORS_MOST = 1024 };

#define END_S 4.5 // from the signal, whatever hangs
// An instrument thread that has not looked at the bench for so long hangs; a dead USB device holds
// it for 5 s.
#define LOOKS_S 6.0
#define ENDED_ALL_THE_SAME                                                                         \
    "goniod: a device or the disk does not answer; ended all the same. Readings are safe. "

struct daemon {
    struct options options;
    struct log *log;
    struct loop *loop;
    struct listener *listener;
    struct simulator *simulator;
    struct guardian *guardian;
    struct guard_host guard;
    struct bench_config bench;
    char *bench_text;
    struct profile_texts profiles;
    char socket[200], directory[4096];
    struct catalog_hold *hold; // of the directory
    struct hub *hub;
    struct deadline *deadline; // NULL: not ending yet
    bool dark;                 // the laser, when the bench was last looked at
    int64_t looked_ns;         // then
    struct service *service;   // NULL: no service manager listens
    bool ready;                // was told
    int status;                // exit status
};

static int say_error(const struct gon_error *err)
{
    fprintf(stderr, "goniod: %s\n", err->text);
    return err->code == GON_E_INPUT ? 2 : err->code == GON_E_REFUSED ? 4 : 1;
}

static int log_level(const char *name, enum log_level *ret_level, struct gon_error *err)
{
    static const char *const names[] = {"error", "warning", "notice", "info", "debug", NULL};
    for (int i = 0; names[i]; i++)
        if (!strcmp(name, names[i])) {
            *ret_level = (enum log_level)i;
            return GON_OK;
        }
    const char *meant = options_suggest(name, names);
    return gon_fail(err, GON_E_INPUT,
                    "--log '%s': did you mean '%s'? error, warning, notice, info, debug", name,
                    meant ? meant : "notice");
}

static int check_options(const struct options *o, int operands, struct gon_error *err)
{
    if (operands > 0)
        return gon_fail(err, GON_E_INPUT, "takes no arguments; see: goniod --help");
    if (o->sim && o->config)
        return gon_fail(err, GON_E_INPUT, "--sim brings its own bench; leave out --config");
    if (!o->sim && (o->fast || o->seed >= 0))
        return gon_fail(err, GON_E_INPUT, "--fast and --seed are for --sim; add --sim");
    if (!o->sim && !o->config)
        return gon_fail(
            err, GON_E_INPUT,
            "which bench? goniod --config goniod.cfg, or goniod --sim for a simulated one");
    return GON_OK;
}

static void print_help(void)
{
    printf("usage: goniod --config FILE [OPTIONS]\n       goniod --sim [--fast] [--seed N] "
           "[OPTIONS]\n\n"
           "Runs the goniometer: owns its devices, measures queued campaigns, fits after\n"
           "each sweep.\n\n");
    options_describe(stdout, rows);
    printf("\nSIGTERM or Ctrl-C: laser off, axes stopped, everything stored, then the end.\n"
           "The command: gonio help\n");
}

// --- callbacks of the loop -----------------------------------------------------------------------

static const char *last_words(bool dark)
{
    return dark ? ENDED_ALL_THE_SAME "The laser is off\n"
                : ENDED_ALL_THE_SAME "LASER MAY BE ON: use its key or the interlock\n";
}

static void looked(void *ctx, const struct instrument_snapshot *s)
{
    struct daemon *d = ctx;
    d->dark = instrument_is_dark(s);
    d->looked_ns = clk_now_ns(clk_system());
    deadline_say(d->deadline, last_words(d->dark));
}

static void signaled(void *ctx, int signal)
{
    struct daemon *d = ctx;
    log_say(d->log, LOG_NOTICE, "goniod", "signal %d: ending; the laser first, then the axes",
            signal);
    service_ending(d->service);
    if (!d->deadline)
        d->deadline = deadline_set(END_S, last_words(d->dark), 1);
    hub_end(d->hub);
}

static void simulator_ended(void *ctx)
{
    struct daemon *d = ctx;
    log_say(d->log, LOG_ERR, "simulator",
            "goniosim ended by itself; end goniod and start it again");
    loop_remove(d->loop, simulator_fd(d->simulator));
}

static void ended(void *ctx, const struct gon_error *err)
{
    struct daemon *d = ctx;
    if (err)
        d->status = say_error(err);
    loop_quit(d->loop);
}

static const char *axes_text(const struct instrument_snapshot *s)
{
    bool homed = true;
    for (int i = 0; i < INSTRUMENT_AXES; i++) {
        if (s->part[i].link == PART_LOST)
            return "not all reachable";
        homed = homed && (s->part[i].link == PART_ABSENT || s->axis[i].homed);
    }
    return homed ? "homed" : "not homed (a run homes them first)";
}

static void ready(void *ctx, const struct instrument_snapshot *s)
{
    struct daemon *d = ctx;
    service_ready(d->service);
    d->ready = true;
    for (int i = 0; i < PART_COUNT; i++)
        if (s->part[i].link == PART_LOST)
            printf("waiting for %s\n", s->part[i].problem);
    bool lost = s->part[PART_LASER].link != PART_OK;
    printf("ready: axes %s, laser %s.   Ctrl-C stops (laser off first).\n", axes_text(s),
           lost                    ? "not reachable"
           : instrument_is_dark(s) ? "off"
                                   : "NOT OFF: use its key or the interlock");
    fflush(stdout);
}

static void say_status(struct daemon *d)
{
    char text[200];
    const struct run *run = queue_active(hub_queue(d->hub));
    if (run)
        snprintf(text, sizeof text, "run %d (%s) %s, %d of %d points", run->id, run->name,
                 run_state_name(run->state), run->done, run->total);
    else
        snprintf(text, sizeof text, "idle, laser %s", d->dark ? "off" : "NOT OFF");
    service_status(d->service, text);
}

// The watchdog is fed by two threads: this one is here, the instrument's has looked at the bench.
// The store's is left out: a disk may stall for a minute, which pauses the run, with the laser off.
static void alive(void *ctx)
{
    struct daemon *d = ctx;
    if (d->ready)
        say_status(d);
    if (clk_now_ns(clk_system()) - d->looked_ns < CLK_S(LOOKS_S))
        service_alive(d->service);
}

// --- beginning and end ---------------------------------------------------------------------------

// All threads inherit the mask: signals are for the loop's descriptor.
static void block_signals(void)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGHUP);
    sigprocmask(SIG_BLOCK, &set, NULL);
    signal(SIGPIPE, SIG_IGN);
}

// Without a descriptor to accept with, nobody could stop a run. Not more than 1024, the most that
// libmodbus can wait for.
static int allow_descriptors(struct gon_error *err)
{
    struct rlimit r;
    getrlimit(RLIMIT_NOFILE, &r);
    if (r.rlim_cur < DESCRIPTORS_MOST) {
        r.rlim_cur = r.rlim_max < DESCRIPTORS_MOST ? r.rlim_max : DESCRIPTORS_MOST;
        setrlimit(RLIMIT_NOFILE, &r);
    }
    if (r.rlim_cur >= DESCRIPTORS_LEAST)
        return GON_OK;
    return gon_fail(err, GON_E_SYSTEM,
                    "only %llu open files are allowed, %d are needed; see: ulimit -n",
                    (unsigned long long)r.rlim_cur, DESCRIPTORS_LEAST);
}

static void say_line(void *ctx, const char *line)
{
    (void)ctx;
    fprintf(stderr, "%s\n", line);
}

static int open_bench(struct daemon *d, struct gon_error *err)
{
    struct simulator_options sim = {d->options.fast, d->options.seed};
    const char *path = d->options.config;
    if (d->options.sim) {
        int rc = simulator_start(&sim, &d->simulator, err);
        if (rc < 0)
            return rc;
        path = simulator_config(d->simulator);
    }
    if (bench_config_load(path, (struct cfg_sink){say_line, NULL}, &d->bench, &d->bench_text) < 0)
        return gon_fail(err, GON_E_INPUT, "%s: mend the bench file; see: gonio check %s", path,
                        path);
    return profile_texts_read(&d->bench, &d->profiles, err);
}

static int open_places(struct daemon *d, struct gon_error *err)
{
    const char *dir = d->options.dir ? d->options.dir : d->bench.directory;
    int rc = catalog_directory(dir, d->directory, sizeof d->directory, err);
    rc = rc < 0 ? rc : catalog_make_directory(d->directory, err);
    rc = rc < 0 ? rc : catalog_take(d->directory, &d->hold, err);
    if (rc == GON_E_REFUSED)
        gon_prefix(err, "campaigns cannot be kept there; choose another folder with --dir");
    return rc;
}

static int open_socket(struct daemon *d, struct gon_error *err)
{
    int rc = GON_OK;
    if (d->options.socket)
        snprintf(d->socket, sizeof d->socket, "%s", d->options.socket);
    else
        rc = paths_socket(d->socket, sizeof d->socket, err);
    if (rc == 0 && d->options.socket)
        rc = paths_socket_fits(d->options.socket, err);
    return rc < 0 ? rc : listener_open(d->socket, &d->listener, err);
}

static void print_banner(const struct daemon *d)
{
    printf("goniod %s  ", GONIO_VERSION);
    if (d->simulator)
        printf("simulator (seed %ld)", d->options.seed);
    else
        printf("%s", d->bench.name);
    printf("   socket %s   campaigns %s\n", d->socket, d->directory);
    fflush(stdout);
}

static int open_hub(struct daemon *d, struct gon_error *err)
{
    struct hub_options o = {
        .bench = &d->bench,
        .guard = &d->guard,
        .bench_text = d->bench_text,
        .profiles = d->profiles.profile,
        .profiles_count = d->profiles.count,
        .directory = d->directory,
        .simulator = d->simulator != NULL,
        .seed = d->options.seed,
        .log = d->log,
        .ready = ready,
        .looked = looked,
        .ended = ended,
        .ctx = d,
    };
    d->guard.brief = d->simulator != NULL;
    int rc = hub_new(d->loop, listener_fd(d->listener), &o, &d->hub, err);
    rc = rc < 0 ? rc : loop_signals(d->loop, signaled, d, err);
    if (rc == 0 && d->simulator)
        rc = loop_add(d->loop, simulator_fd(d->simulator), simulator_ended, d, err);
    if (rc == 0 && d->service)
        rc = loop_every(d->loop, 1000, alive, d, err);
    return rc;
}

// Before there are other threads, and before anything could be switched on.
static int open_guard(struct daemon *d, struct gon_error *err)
{
    int rc = guardian_start(d->socket, &d->guardian, err);
    if (rc < 0)
        return rc;
    guardian_when_crashed(d->guardian);
    d->guard = guardian_host(d->guardian);
    return GON_OK;
}

// The socket first: a second daemon must be refused before it touches a device.
static int run(struct daemon *d)
{
    struct gon_error err;
    int rc = allow_descriptors(&err);
    rc = rc < 0 ? rc : service_open(&d->service, &err);
    rc = rc < 0 ? rc : open_socket(d, &err);
    rc = rc < 0 ? rc : open_guard(d, &err);
    rc = rc < 0 ? rc : open_bench(d, &err);
    rc = rc < 0 ? rc : open_places(d, &err);
    if (rc == 0) {
        print_banner(d);
        d->looked_ns = clk_now_ns(clk_system()); // opening the bench has its time, too
        d->loop = loop_new(&err);
        rc = d->loop ? open_hub(d, &err) : GON_E_SYSTEM;
    }
    if (rc == 0)
        loop_run(d->loop);
    else
        d->status = say_error(&err);
    if (hub_free(d->hub)) {
        fputs("goniod: LASER MAY BE ON: it did not confirm OFF; use its key or the interlock\n",
              stderr);
        d->status = 1;
    }
    guardian_end(d->guardian);
    loop_free(d->loop);
    simulator_stop(d->simulator);
    catalog_drop(d->hold);
    listener_close(d->listener);
    service_close(d->service);
    profile_texts_free(&d->profiles);
    free(d->bench_text);
    return d->status;
}

int main(int argc, char **argv)
{
    struct daemon d = {.options = {.log = "notice", .seed = -1}};
    struct gon_error err;
    enum log_level level = LOG_NOTICE;
    standard_hold();
    int operands = options_take(argc, argv, rows, &d.options, NULL, 0, &err);
    if (operands < 0)
        return say_error(&err);
    if (d.options.help) {
        print_help();
        return 0;
    }
    if (d.options.options) {
        options_manual(stdout, rows);
        return 0;
    }
    if (d.options.version) {
        printf("goniod %s\n", GONIO_VERSION);
        return 0;
    }
    if (check_options(&d.options, operands, &err) < 0 || log_level(d.options.log, &level, &err) < 0)
        return say_error(&err);
    if (d.options.sim && d.options.seed < 0)
        d.options.seed = 7;
    block_signals();
    d.log = log_new(stderr, level, 1);
    int status = run(&d);
    log_free(d.log);
    return status;
}
