// SPDX-License-Identifier: MIT
// A serial line in virtual time. The driver opens a real pty; what it then reads, writes and waits
// for on it goes to a simulated port instead, and waiting moves a virtual clock. It works by
// defining the calls of libc here: they take precedence in the whole program, libmodbus included.
// So thousands of timeouts cost no time, and the same seed gives the same bytes at the same times.
// vline_begin_tcp is the same for a TCP connection: each new one forgets what was under way in the
// one before. One line a program.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "sim/line.h"
#include "sim/port.h"

#include <assert.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

struct vline {
    int master;
    dev_t device;
    bool tcp;
    ino_t socket; // of the connection
    int fd;       // known to be the line until it is closed; 0: none
    struct port *port;
    struct clk_virtual clk;
    char link[96]; // "serial:/dev/pts/N"
    char bus[96];  // "modbus-rtu:/dev/pts/N?baud=115200"; "modbus-tcp:192.0.2.1:502"
    uint8_t in[1 << 16];
    size_t have;
    size_t write_most; // bytes taken by one write; 0: all
    bool stuck;        // takes nothing: the line is full
    int64_t hangup_ns; // the plug is pulled then
    int64_t cancel_ns; // and this is requested then
    struct cancel *cancel;
    int64_t longest_ns; // wait without a turn of the clock
    int64_t turn_ns;
    uint64_t waits;
};

static struct vline vline;

static inline bool vline_is(int fd)
{
    struct stat s;
    if (vline.port && vline.fd > 0 && fd == vline.fd)
        return true;
    if (!vline.port || fstat(fd, &s) != 0)
        return false;
    const bool is = vline.tcp ? S_ISSOCK(s.st_mode) && s.st_ino == vline.socket
                              : S_ISCHR(s.st_mode) && s.st_rdev == vline.device;
    if (is)
        vline.fd = fd;
    return is;
}

static inline bool vline_hung_up(void)
{
    return vline.clk.t_ns >= vline.hangup_ns;
}

static inline void vline_turn(void)
{
    const int64_t silent_ns = vline.clk.t_ns - vline.turn_ns;
    if (silent_ns > vline.longest_ns)
        vline.longest_ns = silent_ns;
    vline.turn_ns = vline.clk.t_ns;
}

static inline void vline_sleep_until(struct clk *clk, int64_t t_ns, const struct cancel *cancel)
{
    (void)clk;
    (void)cancel;
    vline_turn();
    if (t_ns > vline.clk.t_ns)
        vline.turn_ns = vline.clk.t_ns = t_ns;
    if (vline.cancel && vline.clk.t_ns >= vline.cancel_ns)
        cancel_request(vline.cancel);
}

static inline void vline_take(void)
{
    uint8_t bytes[PORT_REPLY_MOST];
    for (size_t n; (n = port_take(vline.port, vline.clk.t_ns, bytes, NULL)) > 0;) {
        assert(vline.have + n <= sizeof vline.in);
        memcpy(vline.in + vline.have, bytes, n);
        vline.have += n;
    }
}

// Moves time to until_ns, or to where there is something to read.
static inline bool vline_wait(int64_t until_ns)
{
    vline.waits++;
    for (;;) {
        vline_take();
        if (vline.have > 0 || vline_hung_up())
            return true;
        if (vline.cancel && vline.clk.t_ns >= vline.cancel_ns) {
            cancel_request(vline.cancel);
            return false;
        }
        int64_t next_ns = port_next_ns(vline.port);
        next_ns = next_ns < until_ns ? next_ns : until_ns;
        next_ns = next_ns < vline.hangup_ns ? next_ns : vline.hangup_ns;
        if (vline.cancel && vline.cancel_ns < next_ns)
            next_ns = vline.cancel_ns;
        if (next_ns <= vline.clk.t_ns && vline.clk.t_ns >= until_ns)
            return false;
        if (next_ns > vline.clk.t_ns)
            vline.clk.t_ns = next_ns;
    }
}

#define VLINE_REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

// By their assembler names: libc declares that poll only writes its array, which is not so.
int vline_ppoll(struct pollfd *fds, nfds_t n, const struct timespec *timeout,
                const sigset_t *mask) __asm__("ppoll");
int vline_poll(struct pollfd *fds, nfds_t n, int timeout_ms) __asm__("poll");

int vline_ppoll(struct pollfd *fds, nfds_t n, const struct timespec *timeout, const sigset_t *mask)
{
    if (n == 0 || !vline_is(fds[0].fd))
        return VLINE_REAL(ppoll)(fds, n, timeout, mask);
    for (nfds_t i = 0; i < n; i++)
        fds[i].revents = 0;
    const int64_t until_ns = vline.clk.t_ns + timeout->tv_sec * 1000000000 + timeout->tv_nsec;
    bool ready = true;
    if (fds[0].events & POLLIN)
        ready = vline_wait(until_ns);
    else if (vline.stuck) {
        vline.clk.t_ns = until_ns;
        ready = false;
    }
    if (ready)
        fds[0].revents = vline_hung_up() && vline.have == 0
                             ? (short)(POLLHUP | (fds[0].events & POLLIN))
                             : fds[0].events;
    return fds[0].revents != 0;
}

int vline_poll(struct pollfd *fds, nfds_t n, int timeout_ms)
{
    if (n == 0 || !vline_is(fds[0].fd))
        return VLINE_REAL(poll)(fds, n, timeout_ms);
    const struct timespec ts = {0, timeout_ms * 1000000L};
    return vline_ppoll(fds, n, &ts, NULL);
}

int select(int n, fd_set *in, fd_set *out, fd_set *error, struct timeval *timeout)
{
    if (!in || !vline_is(n - 1))
        return VLINE_REAL(select)(n, in, out, error, timeout);
    if (vline_wait(vline.clk.t_ns + timeout->tv_sec * 1000000000 + timeout->tv_usec * 1000))
        return 1;
    FD_ZERO(in);
    return 0;
}

ssize_t read(int fd, void *to, size_t size)
{
    if (!vline_is(fd))
        return VLINE_REAL(read)(fd, to, size);
    vline_take();
    if (vline.have == 0) {
        errno = vline_hung_up() ? EIO : EAGAIN;
        return -1;
    }
    size_t n = size < vline.have ? size : vline.have;
    memcpy(to, vline.in, n);
    memmove(vline.in, vline.in + n, vline.have - n);
    vline.have -= n;
    return (ssize_t)n;
}

ssize_t write(int fd, const void *from, size_t size)
{
    if (!vline_is(fd))
        return VLINE_REAL(write)(fd, from, size);
    if (vline_hung_up()) {
        errno = EIO;
        return -1;
    }
    if (vline.write_most && size > vline.write_most)
        size = vline.write_most;
    port_feed(vline.port, from, size, vline.clk.t_ns);
    return (ssize_t)size;
}

int close(int fd)
{
    if (fd == vline.fd)
        vline.fd = 0;
    return VLINE_REAL(close)(fd);
}

ssize_t recv(int fd, void *to, size_t size, int flags)
{
    return vline_is(fd) ? read(fd, to, size) : VLINE_REAL(recv)(fd, to, size, flags);
}

ssize_t send(int fd, const void *from, size_t size, int flags)
{
    return vline_is(fd) ? write(fd, from, size) : VLINE_REAL(send)(fd, from, size, flags);
}

int connect(int fd, const struct sockaddr *address, socklen_t size)
{
    struct stat s;
    if (!vline.tcp || address->sa_family != AF_INET || fstat(fd, &s) != 0)
        return VLINE_REAL(connect)(fd, address, size);
    vline.socket = s.st_ino;
    vline.have = 0;
    port_hangup(vline.port);
    return 0;
}

static inline struct clk *vline_begin_clock(struct port *port)
{
    static struct clk_ops ops;
    if (vline.master > 0)
        close(vline.master);
    memset(&vline, 0, sizeof vline);
    vline.hangup_ns = vline.cancel_ns = PORT_NEVER;
    struct clk *clk = clk_virtual_init(&vline.clk, CLK_S(1), CLK_S(1700000000));
    ops = *clk->ops;
    ops.sleep_until = vline_sleep_until;
    clk->ops = &ops;
    vline.turn_ns = vline.clk.t_ns;
    vline.port = port;
    return clk;
}

static inline struct clk *vline_begin_tcp(struct port *port)
{
    struct clk *clk = vline_begin_clock(port);
    vline.tcp = true;
    snprintf(vline.link, sizeof vline.link, "tcp:192.0.2.1:4001"); // of no network at all
    snprintf(vline.bus, sizeof vline.bus, "modbus-tcp:192.0.2.1:502");
    return clk;
}

static inline struct clk *vline_begin(struct port *port)
{
    struct stat s;
    char name[64];
    struct clk *clk = vline_begin_clock(port);
    vline.master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (vline.master < 0 || grantpt(vline.master) || unlockpt(vline.master) ||
        ptsname_r(vline.master, name, sizeof name) || stat(name, &s))
        abort();
    vline.device = s.st_rdev;
    snprintf(vline.link, sizeof vline.link, "serial:%s", name);
    snprintf(vline.bus, sizeof vline.bus, "modbus-rtu:%s", name);
    return clk;
}

// --- a device that a test writes -----------------------------------------------------------------

struct scripted {
    struct port port; // first
    struct sim_line line;
    const char *ends;
    void (*hear)(struct scripted *s, const char *line, int64_t t_ns);
    int step;
    int64_t heard_ns[64]; // when each of the first lines came
    int heard;
    char last[SIM_LINE_MOST];
};

static inline void scripted_feed(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    struct scripted *s = (struct scripted *)p;
    for (size_t i = 0; i < size; i++)
        if (sim_line_add(&s->line, bytes[i], s->ends)) {
            if (s->heard < 64)
                s->heard_ns[s->heard] = t_ns;
            s->heard++;
            snprintf(s->last, sizeof s->last, "%s", s->line.text);
            s->hear(s, s->line.text, t_ns);
        }
}

static inline void scripted_nothing(struct port *p, int64_t t_ns)
{
    (void)p;
    (void)t_ns;
}

static inline void scripted_hangup(struct port *p)
{
    (void)p;
}

static inline void scripted_init(struct scripted *s, const char *ends,
                                 void (*hear)(struct scripted *s, const char *line, int64_t t_ns))
{
    static const struct port_ops ops = {scripted_feed, scripted_nothing, scripted_hangup};
    memset(s, 0, sizeof *s);
    port_init(&s->port, &ops);
    s->ends = ends;
    s->hear = hear;
}

static inline void scripted_say(struct scripted *s, const char *text, int64_t due_ns)
{
    port_send(&s->port, text, strlen(text), due_ns);
}
