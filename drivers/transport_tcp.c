// SPDX-License-Identifier: MIT
#include "drivers/transport_port.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define DEAD_MS 5000 // unacknowledged data for so long: the peer is gone

static void set(int fd, int level, int option, int value)
{
    setsockopt(fd, level, option, &value, sizeof value); // a kernel without one of them still works
}

// A peer that lost its power answers nothing: 2 s idle, then 3 probes 1 s apart.
static void tune(int fd)
{
    set(fd, IPPROTO_TCP, TCP_NODELAY, 1);
    set(fd, SOL_SOCKET, SO_KEEPALIVE, 1);
    set(fd, IPPROTO_TCP, TCP_KEEPIDLE, 2);
    set(fd, IPPROTO_TCP, TCP_KEEPINTVL, 1);
    set(fd, IPPROTO_TCP, TCP_KEEPCNT, 3);
    set(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, DEAD_MS);
}

// 0 when connected; errno otherwise, ETIMEDOUT at the deadline, ECANCELED.
static int finish_connect(int fd, struct clk *clk, const struct cancel *cancel, int64_t deadline_ns)
{
    for (;;) {
        int rc = transport_slice(fd, POLLOUT, deadline_ns, clk, cancel);
        if (rc == GON_E_CANCELED)
            return ECANCELED;
        if (rc < 0)
            return errno;
        if (rc > 0) {
            int error = 0;
            socklen_t size = sizeof error;
            getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size);
            return error;
        }
        if (clk_now_ns(clk) >= deadline_ns)
            return ETIMEDOUT;
    }
}

int transport_tcp_connect(const struct link *link, struct clk *clk, const struct cancel *cancel,
                          int64_t deadline_ns, struct gon_error *err)
{
    const struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_NUMERICSERV};
    struct addrinfo *list;
    int rc = getaddrinfo(link->place, link->port, &hints, &list);
    if (rc)
        return gon_fail(err, GON_E_GONE, "%s: no address for this host (%s)", link->place,
                        gai_strerror(rc));
    int error = 0, fd = -1;
    for (const struct addrinfo *a = list; a && fd < 0 && error != ECANCELED; a = a->ai_next) {
        fd = socket(a->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, a->ai_protocol);
        if (fd < 0) {
            error = errno;
            continue;
        }
        tune(fd);
        error = connect(fd, a->ai_addr, a->ai_addrlen) == 0 ? 0 : errno;
        if (error == EINPROGRESS)
            error = finish_connect(fd, clk, cancel, deadline_ns);
        if (error) {
            close(fd);
            fd = -1;
        }
    }
    freeaddrinfo(list);
    if (fd >= 0)
        return fd;
    return gon_fail(err, error == ECANCELED ? GON_E_CANCELED : GON_E_GONE,
                    "%s port %s: %s; is it switched on and the port right?", link->place,
                    link->port, strerror(error));
}
