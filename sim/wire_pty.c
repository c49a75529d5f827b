// SPDX-License-Identifier: MIT
// A serial line as a pty. While no client has the slave open the master reports POLLHUP without
// end, so that it is not polled then; inotify on the slave says when somebody opens it. After the
// last close the line goes back to a baud nobody asks for: the C library reports EINVAL for a
// tcsetattr that asks for parity, which ptys cannot have, and changes nothing else. (A client that
// sets the same twice still gets it; pymodbus does so when strict.)
#include "sim/wire.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/inotify.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

enum { MASTER, WATCH };

static void pristine(int master)
{
    struct termios t;
    if (tcgetattr(master, &t))
        return;
    cfmakeraw(&t);
    cfsetspeed(&t, B134);
    tcsetattr(master, TCSANOW, &t);
}

// The link appears, or changes where it points, in one step.
static int publish(const char *target, const char *path, struct gon_error *err)
{
    char draft[610];
    snprintf(draft, sizeof draft, "%s.new", path);
    unlink(draft);
    if (symlink(target, draft) || rename(draft, path))
        return gon_fail(err, GON_E_SYSTEM, "%s -> %s: %s", path, target, strerror(errno));
    return 0;
}

static void close_both(struct wire *w)
{
    for (int i = 0; i < 2; i++) {
        if (w->fd[i] >= 0)
            close(w->fd[i]);
        w->fd[i] = -1;
    }
}

static void pty_close(struct wire *w)
{
    close_both(w);
    unlink(w->address);
}

static int pty_open(struct wire *w, struct gon_error *err)
{
    char slave[64];
    int master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    w->fd[MASTER] = master;
    w->vacant = true;
    if (master < 0 || grantpt(master) || unlockpt(master) ||
        ptsname_r(master, slave, sizeof slave)) {
        int rc = gon_fail(err, GON_E_SYSTEM, "no pty: %s", strerror(errno));
        pty_close(w);
        return rc;
    }
    pristine(master);
    w->fd[WATCH] = inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
    if (w->fd[WATCH] < 0 || inotify_add_watch(w->fd[WATCH], slave, IN_OPEN) < 0) {
        int rc = gon_fail(err, GON_E_SYSTEM, "cannot watch %s: %s", slave, strerror(errno));
        pty_close(w);
        return rc;
    }
    int rc = publish(slave, w->address, err);
    if (rc)
        pty_close(w);
    return rc;
}

static int pty_fds(struct wire *w, struct pollfd fds[WIRE_FDS])
{
    short in = w->rx_size < sizeof w->rx ? POLLIN : 0; // else the line is full
    fds[0] = (struct pollfd){.fd = w->vacant ? -1 : w->fd[MASTER], .events = in};
    fds[1] = (struct pollfd){.fd = w->fd[WATCH], .events = POLLIN};
    return 2;
}

static bool vacant(const struct wire *w)
{
    struct pollfd now = {.fd = w->fd[MASTER], .events = POLLIN};
    return poll(&now, 1, 0) > 0 && (now.revents & POLLHUP);
}

static bool somebody_opened(const struct wire *w)
{
    char events[512];
    bool any = false;
    while (read(w->fd[WATCH], events, sizeof events) > 0)
        any = true;
    return any;
}

// Replies that nobody read stay with the slave and would meet the next client; a serial port
// forgets them when it is closed, as it forgets TIOCEXCL. Only through the slave can that be done,
// and not even there if somebody who is not root finds it claimed: then there is a new pty under
// the same name.
static void forget(struct wire *w)
{
    int slave = ioctl(w->fd[MASTER], TIOCGPTPEER, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (slave < 0) {
        close_both(w);
        pty_open(w, NULL); // without one the wire is dead, as its state then shows
        return;
    }
    ioctl(slave, TIOCNXCL);
    tcflush(slave, TCIFLUSH);
    close(slave);
    somebody_opened(w); // that was here
    pristine(w->fd[MASTER]);
    w->vacant = vacant(w); // else somebody else opened it meanwhile
}

static void leave(struct wire *w)
{
    wire_hangup(w);
    if (!vacant(w))
        return; // opened again already: the line is the new client's
    forget(w);
}

static bool pty_attend(struct wire *w, const struct pollfd *fds)
{
    if ((fds[1].revents & POLLIN) && somebody_opened(w)) {
        w->clients += w->vacant;
        w->vacant = false;
    }
    if (w->vacant)
        return false;
    if (fds[0].revents & POLLIN)
        return true; // what was written before the hang-up is read first
    if (fds[0].revents & (POLLHUP | POLLERR))
        leave(w);
    return false;
}

static int pty_client(const struct wire *w)
{
    return w->vacant ? -1 : w->fd[MASTER];
}

static long pty_baud(const struct wire *w)
{
    static const struct {
        speed_t speed;
        long baud;
    } speeds[] = {{B1200, 1200},     {B2400, 2400},     {B4800, 4800},     {B9600, 9600},
                  {B19200, 19200},   {B38400, 38400},   {B57600, 57600},   {B115200, 115200},
                  {B230400, 230400}, {B460800, 460800}, {B921600, 921600}, {B134, 9600}};
    struct termios t;
    if (w->fd[MASTER] >= 0 && tcgetattr(w->fd[MASTER], &t) == 0)
        for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++)
            if (cfgetospeed(&t) == speeds[i].speed)
                return speeds[i].baud;
    return 9600;
}

static const struct wire_ops ops = {pty_open,   pty_close, pty_fds, pty_attend,
                                    pty_client, pty_baud,  leave};

void wire_pty_init(struct wire *w, const char *name, struct port *port, const char *path)
{
    memset(w, 0, sizeof *w);
    w->ops = &ops;
    w->name = name;
    w->port = port;
    w->bits = 10;
    w->fd[MASTER] = w->fd[WATCH] = -1;
    w->rx_due_ns = w->tx_due_ns = PORT_NEVER;
    snprintf(w->address, sizeof w->address, "%s", path);
}
