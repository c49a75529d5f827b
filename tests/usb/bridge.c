// SPDX-License-Identifier: MIT
#include "tests/usb/bridge.h"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <unistd.h>

static void feed(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    const ssize_t n = send(((struct bridge *)p)->fd, bytes, size, MSG_NOSIGNAL);
    (void)n; // whoever asks hears nothing then
    (void)t_ns;
}

static void tick(struct port *p, int64_t t_ns)
{
    (void)p;
    (void)t_ns;
}

static void hangup(struct port *p)
{
    (void)p;
}

void bridge_take(struct bridge *b, int64_t t_ns)
{
    uint8_t bytes[PORT_REPLY_MOST];
    for (ssize_t n; (n = recv(b->fd, bytes, sizeof bytes, MSG_DONTWAIT)) > 0;)
        port_send(&b->port, bytes, (size_t)n, t_ns);
}

struct bridge *bridge_new(int tcp_port)
{
    static const struct port_ops ops = {feed, tick, hangup};
    const int on = 1;
    struct sockaddr_in to = {.sin_family = AF_INET,
                             .sin_port = htons((uint16_t)tcp_port),
                             .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    struct bridge *b = calloc(1, sizeof *b);
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (!b || fd < 0 || connect(fd, (struct sockaddr *)&to, sizeof to)) {
        free(b);
        if (fd >= 0)
            close(fd);
        return NULL;
    }
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    port_init(&b->port, &ops);
    b->fd = fd;
    return b;
}

void bridge_free(struct bridge *b)
{
    if (!b)
        return;
    close(b->fd);
    free(b);
}
