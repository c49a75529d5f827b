// SPDX-License-Identifier: MIT
// A wire as a TCP listener on 127.0.0.1, as serial servers and Modbus gateways give. Unplugging
// closes the connection with a reset and the listener; plugging in listens on the same port again.
#include "sim/wire.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { LISTENER, CLIENT };

static void drop_client(struct wire *w)
{
    if (w->fd[CLIENT] >= 0)
        close(w->fd[CLIENT]);
    w->fd[CLIENT] = -1;
}

static void tcp_close(struct wire *w)
{
    struct linger now = {.l_onoff = 1}; // a reset, not a good-bye
    if (w->fd[CLIENT] >= 0)
        setsockopt(w->fd[CLIENT], SOL_SOCKET, SO_LINGER, &now, sizeof now);
    drop_client(w);
    if (w->fd[LISTENER] >= 0)
        close(w->fd[LISTENER]);
    w->fd[LISTENER] = -1;
}

static int tcp_open(struct wire *w, struct gon_error *err)
{
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_port = htons((uint16_t)w->port_number)};
    socklen_t size = sizeof a;
    int yes = 1;
    a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    w->fd[LISTENER] = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    int fd = w->fd[LISTENER];
    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) ||
        bind(fd, (struct sockaddr *)&a, sizeof a) || listen(fd, 4) ||
        getsockname(fd, (struct sockaddr *)&a, &size)) {
        int rc = gon_fail(err, GON_E_SYSTEM, "cannot listen on 127.0.0.1 port %ld: %s",
                          w->port_number, strerror(errno));
        tcp_close(w);
        return rc;
    }
    w->port_number = ntohs(a.sin_port);
    snprintf(w->address, sizeof w->address, "127.0.0.1:%ld", w->port_number);
    return 0;
}

static int tcp_fds(struct wire *w, struct pollfd fds[WIRE_FDS])
{
    short in = w->rx_size < sizeof w->rx ? POLLIN : 0; // else the line is full
    fds[0] = (struct pollfd){.fd = w->fd[CLIENT], .events = in};
    fds[1] = (struct pollfd){.fd = w->fd[LISTENER], .events = POLLIN};
    return 2;
}

static void tcp_lost(struct wire *w)
{
    drop_client(w);
    wire_hangup(w);
}

static bool gone(int fd)
{
    char byte;
    ssize_t n = recv(fd, &byte, 1, MSG_PEEK | MSG_DONTWAIT);
    return n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR);
}

static void welcome(struct wire *w)
{
    int fd = accept4(w->fd[LISTENER], NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    int yes = 1;
    if (fd < 0)
        return;
    if (w->fd[CLIENT] >= 0 && !gone(w->fd[CLIENT])) {
        close(fd); // one at a time
        return;
    }
    if (w->fd[CLIENT] >= 0)
        tcp_lost(w);
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    w->fd[CLIENT] = fd;
    w->clients++;
}

static bool tcp_attend(struct wire *w, const struct pollfd *fds)
{
    bool readable = fds[0].revents != 0 && fds[0].fd == w->fd[CLIENT] && w->fd[CLIENT] >= 0;
    if (!readable && (fds[1].revents & POLLIN))
        welcome(w);
    return readable;
}

static int tcp_client(const struct wire *w)
{
    return w->fd[CLIENT];
}

static long tcp_baud(const struct wire *w)
{
    (void)w;
    return 0;
}

static const struct wire_ops ops = {tcp_open,   tcp_close, tcp_fds, tcp_attend,
                                    tcp_client, tcp_baud,  tcp_lost};

void wire_tcp_init(struct wire *w, const char *name, struct port *port)
{
    memset(w, 0, sizeof *w);
    w->ops = &ops;
    w->name = name;
    w->port = port;
    w->bits = 10;
    w->fd[LISTENER] = w->fd[CLIENT] = -1;
    w->rx_due_ns = w->tx_due_ns = PORT_NEVER;
}
