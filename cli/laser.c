// SPDX-License-Identifier: MIT
// laser off: through the guard's STOP socket, which needs no goniod; where there is no guard, by
// opening the laser here. The other words ask goniod (cli/laser_arm.c).
#include "base/paths.h"
#include "campaign/bench.h"
#include "cli/laser_arm.h"
#include "cli/out.h"
#include "cli/verb.h"
#include "drivers/device.h"
#include "drivers/laser.h"

#include <errno.h>
#include <jansson.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define PATIENCE_S 5.0
#define MAY_BE_ON "LASER MAY BE ON: use its key or the interlock"

struct options {
    const char *socket, *bench, *link, *driver, *time, *reason;
    double power_w;
    bool json;
};

static const struct option_row rows[] = {
    {"--socket", OPTION_TEXT, offsetof(struct options, socket), "PATH", 0, 0,
     "the daemon's socket ($GONIO_SOCKET); the guard's is beside it"},
    {"--bench", OPTION_TEXT, offsetof(struct options, bench), "FILE", 0, 0,
     "without a guard: the bench file that names the laser"},
    {"--link", OPTION_TEXT, offsetof(struct options, link), "LINK", 0, 0,
     "or the laser's link, and"},
    {"--driver", OPTION_TEXT, offsetof(struct options, driver), "NAME", 0, 0, "its profile"},
    {"--for", OPTION_TEXT, offsetof(struct options, time), "TIME", 0, 0,
     "arm, align: so long, 8h, 90min, 30s; arm otherwise as the bench file says"},
    {"--power", OPTION_REAL, offsetof(struct options, power_w), "W", 0, 100,
     "align: the set-point, at most laser.align_power_w"},
    {"--reason", OPTION_TEXT, offsetof(struct options, reason), "TEXT", 0, 0,
     "arm: what for, for the others"},
    {"--json", OPTION_FLAG, offsetof(struct options, json), NULL, 0, 0, "print JSON"},
    VERB_OPTIONS_END,
};

static int say_off(const struct options *o, const char *text)
{
    if (o->json) {
        json_t *j = json_pack("{s:b, s:s}", "laser_off", 1, "text", text);
        out_json(j);
        json_decref(j);
    } else {
        printf("%s\n", text);
    }
    return EXIT_OK;
}

static int say_not_off(const struct options *o, const char *text)
{
    if (o->json) {
        json_t *j = json_pack("{s:b, s:s}", "laser_off", 0, "text", text);
        out_json(j);
        json_decref(j);
    }
    out_say("%s", text);
    return EXIT_FAILED;
}

// --- the guard -----------------------------------------------------------------------------------

// A connection to it means OFF. -1: nobody is there.
static int connect_to(const char *path)
{
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    snprintf(a.sun_path, sizeof a.sun_path, "%.*s", (int)sizeof a.sun_path - 1, path);
    if (fd < 0 || connect(fd, (struct sockaddr *)&a, sizeof a) == 0)
        return fd;
    const int error = errno;
    close(fd);
    errno = error;
    return -1;
}

// Its line, without the newline; false: none came in time.
static bool take_line(int fd, char *line, size_t size)
{
    const int64_t until_ns = clk_now_ns(clk_system()) + CLK_S(PATIENCE_S);
    size_t have = 0;
    while (have + 1 < size && !memchr(line, '\n', have)) {
        const int64_t left_ns = until_ns - clk_now_ns(clk_system());
        struct pollfd p = {fd, POLLIN, 0};
        if (left_ns <= 0 || poll(&p, 1, (int)(left_ns / 1000000) + 1) < 0)
            return false;
        const ssize_t n = p.revents ? read(fd, line + have, size - 1 - have) : 0;
        if (p.revents && n <= 0)
            return false;
        have += (size_t)n;
    }
    line[have] = 0;
    line[strcspn(line, "\n")] = 0;
    return true;
}

static int ask_guard(const struct options *o, int fd)
{
    char line[400];
    const bool answered =
        send(fd, "off\n", 4, MSG_NOSIGNAL) == 4 && take_line(fd, line, sizeof line);
    close(fd);
    if (!answered)
        return say_not_off(
            o, MAY_BE_ON "; its guard sent OFF, goes on sending it, and did not read it back yet");
    return strncmp(line, "laser off", 9) == 0 ? say_off(o, line) : say_not_off(o, line);
}

// --- without one ---------------------------------------------------------------------------------

static void complain(void *ctx, const char *line)
{
    (void)ctx;
    fprintf(stderr, "%s\n", line);
}

// Opening sends nothing: the first bytes are OFF.
static int switch_off(const char *driver, const char *folder, const char *link,
                      struct gon_error *err)
{
    const int64_t until_ns = clk_now_ns(clk_system()) + CLK_S(PATIENCE_S);
    struct profile *profile = NULL;
    struct laser *laser;
    int rc = device_open_laser(driver, folder, &profile, link, clk_system(), NULL, &laser, err);
    if (rc == 0) {
        do
            rc = laser->ops->off(laser, err);
        while (rc < 0 && rc != GON_E_GONE && clk_now_ns(clk_system()) < until_ns);
        laser->ops->free(laser);
    }
    free(profile);
    return rc;
}

static int off_here(const struct options *o)
{
    struct bench_config *bench = calloc(1, sizeof *bench);
    struct gon_error err = {0};
    char *text = NULL, line[600];
    const char *link = o->link, *driver = o->driver;
    int rc = bench ? 0 : gon_fail(&err, GON_E_SYSTEM, "out of memory");
    if (rc == 0 && o->bench) {
        rc = bench_config_load(o->bench, (struct cfg_sink){complain, NULL}, bench, &text);
        if (rc < 0)
            gon_fail(&err, GON_E_INPUT, "%s: not usable; see: gonio check %s", o->bench, o->bench);
        link = bench->laser.link;
        driver = bench->laser.driver;
    }
    rc = rc < 0 ? rc : switch_off(driver, o->bench ? bench->folder : NULL, link, &err);
    if (rc == 0)
        snprintf(line, sizeof line, "laser off: read back from %s", link);
    else
        snprintf(line, sizeof line, "%s%.480s", strstr(err.text, "MAY BE ON") ? "" : MAY_BE_ON "; ",
                 err.text);
    int status = rc == 0 ? say_off(o, line) : say_not_off(o, line);
    if (rc == GON_E_INPUT || rc == GON_E_REFUSED)
        status = rc == GON_E_INPUT ? EXIT_INPUT : EXIT_REFUSED;
    free(text);
    free(bench);
    return status;
}

// --- the verb ------------------------------------------------------------------------------------

static int off(const struct options *o)
{
    char socket[200], path[200]; // of at most 107 bytes, as was checked
    struct gon_error err;
    int rc =
        o->socket ? paths_socket_fits(o->socket, &err) : paths_socket(socket, sizeof socket, &err);
    rc = rc < 0 ? rc : paths_guard(o->socket ? o->socket : socket, path, sizeof path, &err);
    if (rc < 0)
        return out_fail(&err);
    const int fd = connect_to(path);
    if (fd >= 0)
        return ask_guard(o, fd);
    if (errno == EACCES || errno == EPERM) {
        out_say("laser off: %s: permission denied; use an account of its group, or the laser's key",
                path);
        return EXIT_REFUSED;
    }
    if (o->bench || o->link)
        return off_here(o);
    out_say("laser off: no guard on %s, so that no goniod of this account has a laser; to open the "
            "laser itself: gonio laser off --bench goniod.cfg",
            path);
    return EXIT_NO_DAEMON;
}

static int run_laser(const struct verb *verb, int argc, char **argv)
{
    struct options o = {0};
    const char *what = NULL;
    if (verb_take(verb, argc, argv, &o, &what, 0, 1) < 0)
        return EXIT_INPUT;
    const bool off_asked = what && !strcmp(what, "off");
    if (off_asked && (o.time || o.reason || o.power_w > 0)) {
        out_say("laser off: --for, --reason and --power are for arm and align");
        return EXIT_INPUT;
    }
    if (!off_asked && (o.bench || o.link || o.driver)) {
        out_say("laser: --bench, --link and --driver are for laser off");
        return EXIT_INPUT;
    }
    if (!off_asked)
        return laser_ask(&(struct remote_options){o.socket, o.json}, what, o.time, o.reason,
                         o.power_w);
    if (!o.link != !o.driver || (o.link && o.bench)) {
        out_say("laser off: --link and --driver belong together, and --bench gives both");
        return EXIT_INPUT;
    }
    return off(&o);
}

const struct verb verb_laser = {
    "laser",
    "[arm | disarm | align | off]",
    "arm the laser, disarm it, switch it off",
    "Without a word: whether the laser is armed, by whom and until when, and whether light comes "
    "out. arm allows runs to switch it on, in the name in GONIO_NAME or your login; it switches "
    "nothing on. It ends at its time, with disarm, with an operator's pause or one that waits for a "
    "person, with a stop and with goniod; emission that is on then goes off and the run pauses.\n"
    "align switches it on at a low power while no run has the bench, where the bench file allows it "
    "(laser.align_power_w), for 30 min at most; laser off, disarm and stop end it.\n"
    "off switches the laser off through its guard, the process that holds its port and lives on when "
    "goniod hangs or dies, and says so when the laser confirmed it; a run pauses then, and goes on "
    "after gonio resume. Where no guard is (goniod does not run), --bench FILE, or --link and "
    "--driver, opens the laser here and does the same. Status 0 only when off was read back; 1: "
    "LASER MAY BE ON; 3: no guard, and no laser was named.\n",
    rows,
    run_laser};
