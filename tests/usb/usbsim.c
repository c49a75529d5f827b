// SPDX-License-Identifier: MIT
// uses: sim drivers model base
// with: usbserver ttyserver bridge profiled
// Instruments on USB and serial adapters, for programs under umockdev-wrapper. Says "dir PATH"
// (their UMOCKDEV_DIR), then takes lines on standard input and answers each with "ok" or "error".
// Devices 0 and 1 are two power meters of tests/usb/meter.h, P0000001 and P0000002; more are made:
//
//   profile NAME               "ok DEVICE": the instrument of that profile, at its own link
//   bridge PORT END VID PID SERIAL
//                              "ok DEVICE": the one behind 127.0.0.1:PORT, whose lines end with
//                              END: cr, lf or crlf
//
//   plug DEVICE BUS ADDRESS
//   unplug DEVICE
//   after MS unplug DEVICE     once that time has passed
//   fault DEVICE NAME COUNT    as in sim/usbtmc.h
//   delay DEVICE MS            of the next reply
//   mute DEVICE 0|1
//   set DEVICE ASSIGNMENTS     of a profile's: "power_w = 0.002"
//   seen DEVICE REQUEST        "ok N": class requests with this number
//
//   plug-tty N BUS ADDRESS VID PID SERIAL PTY     an adapter with /dev/ttyUSB<N>; SERIAL "-": none
//   unplug-tty N
//   seen-tty N                 "ok N": the modem's lines were asked or set so often
//
// Ends at the end of its input.
#include "base/clk.h"
#include "tests/usb/bridge.h"
#include "tests/usb/meter.h"
#include "tests/usb/profiled.h"
#include "tests/usb/ttyserver.h"
#include "tests/usb/usbserver.h"

#include <poll.h>
#include <unistd.h>

enum { METERS = 2, NUMBER = 64 };

// What is behind a USB device: one of these.
struct device {
    struct port *port;
    struct profiled *profiled;
    struct bridge *bridge;
    struct sim_usb_identity identity;
    char serial[NUMBER];
    int64_t unplug_ns;
};

struct simulator {
    struct usbserver *server;
    struct ttyserver *ttys;
    struct meter meter[METERS];
    struct device device[USBSERVER_DEVICES];
    int devices;
    char line[256];
    size_t have;
};

static int64_t now_ns(void)
{
    return clk_now_ns(clk_system());
}

// --- devices -------------------------------------------------------------------------------------

static struct device *add(struct simulator *s, struct port *port, const char *end)
{
    struct device *d = &s->device[s->devices++];
    d->port = port;
    d->unplug_ns = PORT_NEVER;
    usbserver_lock(s->server);
    usbserver_add(s->server, port, end, &d->identity);
    usbserver_unlock(s->server);
    return d;
}

static void add_meter(struct simulator *s, int i, const char *serial)
{
    meter_init(&s->meter[i]);
    s->device[s->devices].identity =
        (struct sim_usb_identity){0x1313, 0x8072, "Thorlabs", "PM100USB", serial};
    add(s, &s->meter[i].port, "\n");
}

static bool add_profile(struct simulator *s, const char *name)
{
    struct profiled *p = profiled_new(name);
    if (!p)
        return false;
    s->device[s->devices].identity = p->identity;
    add(s, &p->message.port, p->profile->framing.end_in)->profiled = p;
    return true;
}

static bool add_bridge(struct simulator *s, const char *line)
{
    struct device *d = &s->device[s->devices];
    int port;
    char end[8];
    unsigned vendor, product;
    if (sscanf(line, "bridge %d %7s %x %x %63s", &port, end, &vendor, &product, d->serial) != 5)
        return false;
    struct bridge *b = bridge_new(port);
    if (!b)
        return false;
    d->identity = (struct sim_usb_identity){(uint16_t)vendor, (uint16_t)product, "goniosim",
                                            "instrument", d->serial};
    add(s, &b->port,
        strcmp(end, "cr") == 0     ? "\r"
        : strcmp(end, "crlf") == 0 ? "\r\n"
                                   : "\n")
        ->bridge = b;
    return true;
}

// --- lines ---------------------------------------------------------------------------------------

// These answer what is to be said; NULL: not understood.

static const char *make(struct simulator *s, const char *line, char *text, size_t size)
{
    char name[200];
    if (s->devices == USBSERVER_DEVICES)
        return NULL;
    const bool made =
        sscanf(line, "profile %199s", name) == 1 ? add_profile(s, name) : add_bridge(s, line);
    snprintf(text, size, "ok %d", s->devices - 1);
    return made ? text : NULL;
}

// Under the lock.
static const char *change(struct simulator *s, int i, const char *line, char *text, size_t size)
{
    struct sim_usbtmc *u = usbserver_model(s->server, i);
    struct device *d = &s->device[i];
    char name[32];
    unsigned n;
    int at = 0;
    if (sscanf(line, "fault %*d %31s %u", name, &n) == 2)
        return sim_usbtmc_set_fault(u, name, n) ? text : NULL;
    if (sscanf(line, "delay %*d %u", &n) == 1)
        d->port->delay_ns = CLK_MS(n);
    else if (sscanf(line, "mute %*d %u", &n) == 1)
        d->port->mute = n != 0;
    else if (sscanf(line, "set %*d %n", &at) == 0 && at > 0 && d->profiled)
        return actor_set(&d->profiled->actor, line + at, now_ns(), NULL) < 0 ? NULL : text;
    else if (sscanf(line, "seen %*d %u", &n) == 1 && n < 256)
        snprintf(text, size, "ok %llu", (unsigned long long)u->requests[n]);
    else
        return NULL;
    return text;
}

static bool is_tty(int n)
{
    return n >= 0 && n < TTYSERVER_PORTS;
}

static const char *change_tty(struct simulator *s, const char *line, char *text, size_t size)
{
    struct tty_adapter a;
    char serial[NUMBER], pty[NUMBER];
    int n;
    if (sscanf(line, "plug-tty %d %d %d %x %x %63s %63s", &n, &a.bus, &a.address, &a.vendor,
               &a.product, serial, pty) == 7 &&
        is_tty(n)) {
        a.serial = serial;
        a.pty = pty;
        ttyserver_plug(s->ttys, n, &a);
    } else if (sscanf(line, "unplug-tty %d", &n) == 1 && is_tty(n))
        ttyserver_unplug(s->ttys, n);
    else if (sscanf(line, "seen-tty %d", &n) == 1 && is_tty(n))
        snprintf(text, size, "ok %u", ttyserver_seen(s->ttys, n));
    else
        return NULL;
    return text;
}

static bool is_device(const struct simulator *s, int i)
{
    return i >= 0 && i < s->devices;
}

static const char *plugging(struct simulator *s, const char *line, char *text)
{
    int i, a, b;
    if (sscanf(line, "plug %d %d %d", &i, &a, &b) == 3 && is_device(s, i))
        usbserver_plug(s->server, i, a, b);
    else if (sscanf(line, "unplug %d", &i) == 1 && is_device(s, i))
        usbserver_unplug(s->server, i);
    else if (sscanf(line, "after %d unplug %d", &a, &i) == 2 && is_device(s, i))
        s->device[i].unplug_ns = now_ns() + CLK_MS(a);
    else
        return NULL;
    return text;
}

static const char *answer(struct simulator *s, const char *line, char *text, size_t size)
{
    int i;
    if (strstr(line, "-tty "))
        return change_tty(s, line, text, size);
    if (strncmp(line, "profile ", 8) == 0 || strncmp(line, "bridge ", 7) == 0)
        return make(s, line, text, size);
    if (strstr(line, "plug "))
        return plugging(s, line, text);
    if (sscanf(line, "%*s %d", &i) != 1 || !is_device(s, i))
        return NULL;
    usbserver_lock(s->server);
    const char *said = change(s, i, line, text, size);
    usbserver_unlock(s->server);
    return said;
}

// False at the end of input.
static bool take_input(struct simulator *s)
{
    const ssize_t n = read(STDIN_FILENO, s->line + s->have, sizeof s->line - 1 - s->have);
    if (n <= 0)
        return false;
    s->have += (size_t)n;
    s->line[s->have] = 0;
    for (char *end; (end = strchr(s->line, '\n'));) {
        char text[40] = "ok";
        *end = 0;
        const char *said = answer(s, s->line, text, sizeof text);
        printf("%s\n", said ? said : "error");
        fflush(stdout);
        s->have -= (size_t)(end + 1 - s->line);
        memmove(s->line, end + 1, s->have + 1);
    }
    return s->have < sizeof s->line - 1;
}

// --- time ----------------------------------------------------------------------------------------

static int64_t next_ns(struct simulator *s)
{
    int64_t due_ns = usbserver_next_ns(s->server);
    for (int i = 0; i < s->devices; i++)
        due_ns = s->device[i].unplug_ns < due_ns ? s->device[i].unplug_ns : due_ns;
    return due_ns;
}

static void step(struct simulator *s)
{
    usbserver_lock(s->server);
    for (int i = 0; i < s->devices; i++)
        if (s->device[i].bridge)
            bridge_take(s->device[i].bridge, now_ns());
    usbserver_unlock(s->server);
    for (int i = 0; i < s->devices; i++)
        if (s->device[i].unplug_ns <= now_ns()) {
            s->device[i].unplug_ns = PORT_NEVER;
            usbserver_unplug(s->server, i);
        }
    usbserver_step(s->server);
}

// True when a line can be read.
static bool wait_for_events(struct simulator *s)
{
    struct pollfd p[2 + USBSERVER_DEVICES] = {{STDIN_FILENO, POLLIN, 0},
                                              {usbserver_fd(s->server), POLLIN, 0}};
    nfds_t n = 2;
    for (int i = 0; i < s->devices; i++)
        if (s->device[i].bridge)
            p[n++] = (struct pollfd){s->device[i].bridge->fd, POLLIN, 0};
    const int64_t due_ns = next_ns(s), left_ns = due_ns - now_ns();
    const struct timespec ts = {left_ns > 0 ? left_ns / 1000000000 : 0,
                                left_ns > 0 ? left_ns % 1000000000 : 0};
    ppoll(p, n, due_ns == PORT_NEVER ? NULL : &ts, NULL);
    return p[0].revents & (POLLIN | POLLHUP);
}

int main(void)
{
    static struct simulator s;
    bool line;
    s.server = usbserver_new();
    s.ttys = ttyserver_new(s.server);
    add_meter(&s, 0, "P0000001");
    add_meter(&s, 1, "P0000002");
    printf("dir %s\n", usbserver_dir(s.server));
    fflush(stdout);
    do {
        line = wait_for_events(&s);
        step(&s);
    } while (!line || take_input(&s));
    ttyserver_free(s.ttys);
    usbserver_free(s.server);
    for (int i = 0; i < s.devices; i++) {
        profiled_free(s.device[i].profiled);
        bridge_free(s.device[i].bridge);
    }
    return 0;
}
