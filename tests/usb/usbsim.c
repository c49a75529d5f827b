// SPDX-License-Identifier: MIT
// uses: sim model base
// with: usbserver
// Two simulated power meters on USB, for programs under umockdev-wrapper. Says "dir PATH" (their
// UMOCKDEV_DIR), then takes lines on standard input and answers each with "ok" or "error":
//
//   plug METER BUS ADDRESS     METER is 0 or 1, with serial P0000001 or P0000002
//   unplug METER
//   after MS unplug METER      once that time has passed
//   fault METER NAME COUNT     as in sim/usbtmc.h
//   delay METER MS             of the next reply
//   mute METER 0|1
//   seen METER REQUEST         "ok N": class requests with this number
//
// Ends at the end of its input.
#include "base/clk.h"
#include "tests/usb/meter.h"
#include "tests/usb/usbserver.h"

#include <poll.h>
#include <unistd.h>

enum { METERS = 2 };

struct simulator {
    struct usbserver *server;
    struct meter meter[METERS];
    int64_t unplug_ns[METERS];
    char line[256];
    size_t have;
};

static int64_t after_ms(int ms)
{
    return clk_now_ns(clk_system()) + CLK_MS(ms);
}

// About one meter, under the lock. Returns what to answer; NULL: not understood.
static const char *change(struct simulator *s, int i, const char *line, char *text, size_t size)
{
    struct sim_usbtmc *u = usbserver_model(s->server, i);
    char name[32];
    unsigned n;
    if (sscanf(line, "fault %*d %31s %u", name, &n) == 2)
        return sim_usbtmc_set_fault(u, name, n) ? "ok" : NULL;
    if (sscanf(line, "delay %*d %u", &n) == 1)
        s->meter[i].port.delay_ns = CLK_MS(n);
    else if (sscanf(line, "mute %*d %u", &n) == 1)
        s->meter[i].port.mute = n != 0;
    else if (sscanf(line, "seen %*d %u", &n) == 1 && n < 256)
        snprintf(text, size, "ok %llu", (unsigned long long)u->requests[n]);
    else
        return NULL;
    return text;
}

static void obey(struct simulator *s, const char *line)
{
    char text[40] = "ok";
    const char *said = text;
    int i, a, b;
    if (sscanf(line, "plug %d %d %d", &i, &a, &b) == 3 && i >= 0 && i < METERS)
        usbserver_plug(s->server, i, a, b);
    else if (sscanf(line, "unplug %d", &i) == 1 && i >= 0 && i < METERS)
        usbserver_unplug(s->server, i);
    else if (sscanf(line, "after %d unplug %d", &a, &i) == 2 && i >= 0 && i < METERS)
        s->unplug_ns[i] = after_ms(a);
    else if (sscanf(line, "%*s %d", &i) == 1 && i >= 0 && i < METERS) {
        usbserver_lock(s->server);
        said = change(s, i, line, text, sizeof text);
        usbserver_unlock(s->server);
    } else
        said = NULL;
    printf("%s\n", said ? said : "error");
    fflush(stdout);
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
        *end = 0;
        obey(s, s->line);
        s->have -= (size_t)(end + 1 - s->line);
        memmove(s->line, end + 1, s->have + 1);
    }
    return s->have < sizeof s->line - 1;
}

static int64_t next_ns(struct simulator *s)
{
    int64_t due_ns = usbserver_next_ns(s->server);
    for (int i = 0; i < METERS; i++)
        due_ns = s->unplug_ns[i] < due_ns ? s->unplug_ns[i] : due_ns;
    return due_ns;
}

static void step(struct simulator *s)
{
    for (int i = 0; i < METERS; i++)
        if (s->unplug_ns[i] <= clk_now_ns(clk_system())) {
            s->unplug_ns[i] = PORT_NEVER;
            usbserver_unplug(s->server, i);
        }
    usbserver_step(s->server);
}

static void wait_for_events(struct simulator *s, struct pollfd p[2])
{
    const int64_t due_ns = next_ns(s), left_ns = due_ns - clk_now_ns(clk_system());
    const struct timespec ts = {left_ns > 0 ? left_ns / 1000000000 : 0,
                                left_ns > 0 ? left_ns % 1000000000 : 0};
    ppoll(p, 2, due_ns == PORT_NEVER ? NULL : &ts, NULL);
}

int main(void)
{
    static struct simulator s;
    static const struct sim_usb_identity identity[METERS] = {
        {0x1313, 0x8072, "Thorlabs", "PM100USB", "P0000001"},
        {0x1313, 0x8072, "Thorlabs", "PM100USB", "P0000002"}};
    s.server = usbserver_new();
    for (int i = 0; i < METERS; i++) {
        meter_init(&s.meter[i]);
        s.unplug_ns[i] = PORT_NEVER;
        usbserver_add(s.server, &s.meter[i].port, "\n", &identity[i]);
    }
    printf("dir %s\n", usbserver_dir(s.server));
    fflush(stdout);
    struct pollfd p[2] = {{STDIN_FILENO, POLLIN, 0}, {usbserver_fd(s.server), POLLIN, 0}};
    do {
        wait_for_events(&s, p);
        step(&s);
    } while (!(p[0].revents & (POLLIN | POLLHUP)) || take_input(&s));
    usbserver_free(s.server);
    return 0;
}
