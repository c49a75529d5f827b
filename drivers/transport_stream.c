// SPDX-License-Identifier: MIT
// The kinds of links that are descriptors: serial ports and TCP connections.
#include "drivers/transport_kind.h"
#include "drivers/transport_port.h"

#include <errno.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define CONNECT_NS CLK_S(2)

// Errors after which a descriptor never recovers.
static bool is_gone(int error)
{
    switch (error) {
    case EIO:
    case ENXIO:
    case ENODEV:
    case EBADF:
    case EPIPE:
    case ECONNRESET:
    case ECONNABORTED:
    case ENOTCONN:
    case ETIMEDOUT: // of TCP_USER_TIMEOUT and keepalive
    case EHOSTUNREACH:
    case ENETDOWN:
    case ENETUNREACH: return true;
    default: return false;
    }
}

static void stream_shut(struct transport *t)
{
    if (t->serial)
        transport_serial_close(t->serial);
    else if (t->fd >= 0)
        close(t->fd);
    t->serial = NULL;
    t->fd = -1;
}

static int stream_open(struct transport *t, struct gon_error *err)
{
    int rc;
    if (t->link.kind == LINK_SERIAL) {
        rc = transport_serial_open(&t->link, &t->serial, err);
        if (rc == 0)
            t->fd = transport_serial_fd(t->serial);
    } else {
        rc = transport_tcp_connect(&t->link, t->clk, t->cancel, clk_now_ns(t->clk) + CONNECT_NS,
                                   err);
        if (rc >= 0)
            t->fd = rc;
    }
    return rc < 0 ? rc : 0;
}

int transport_slice(int fd, short events, int64_t until_ns, struct clk *clk,
                    const struct cancel *cancel)
{
    int64_t now_ns = clk_now_ns(clk), left_ns = until_ns - now_ns;
    if (left_ns < 0)
        left_ns = 0;
    if (left_ns > TRANSPORT_SLICE_NS)
        left_ns = TRANSPORT_SLICE_NS;
    struct pollfd p[2] = {{fd, events, 0}, {cancel_fd(cancel), POLLIN, 0}};
    const struct timespec ts = {0, (long)left_ns};
    if (ppoll(p, 2, &ts, NULL) < 0 && errno != EINTR)
        return GON_E_SYSTEM;
    if (cancel_requested(cancel))
        return GON_E_CANCELED;
    if (p[0].revents)
        return p[0].revents;
    clk_sleep_until(clk, now_ns, NULL); // nothing came: the clock's turn
    return 0;
}

// Waits for events: their revents, 0 at the deadline, or an error.
static int await(struct transport *t, short events, int64_t deadline_ns, struct gon_error *err)
{
    if (t->fd < 0)
        return gon_fail(err, GON_E_GONE, "%s: not open since it hung up", t->text);
    for (;;) {
        transport_take_turn(t);
        int rc = transport_slice(t->fd, events, deadline_ns, t->clk, t->cancel);
        if (rc > 0)
            return rc;
        if (rc == GON_E_CANCELED)
            return gon_fail(err, rc, "%s: stopped while waiting", t->text);
        if (rc < 0)
            return gon_fail(err, rc, "%s: poll: %s", t->text, strerror(errno));
        if (clk_now_ns(t->clk) >= deadline_ns)
            return 0;
    }
}

// Bytes moved, 0 when the descriptor has to be waited for again, GON_E_GONE.
static int moved(struct transport *t, ssize_t n, int revents, struct gon_error *err)
{
    if (n > 0)
        return (int)n;
    if (n < 0 && (errno == EAGAIN || errno == EINTR) && !(revents & (POLLHUP | POLLERR | POLLNVAL)))
        return 0;
    if (n < 0 && errno != EAGAIN && errno != EINTR && !is_gone(errno))
        return gon_fail(err, GON_E_SYSTEM, "%s: %s", t->text, strerror(errno));
    return transport_hung_up(t, n < 0 && is_gone(errno) ? errno : 0, err);
}

static int stream_write(struct transport *t, const void *data, size_t size, int64_t deadline_ns,
                        struct gon_error *err)
{
    const char *bytes = data;
    size_t done = 0;
    while (done < size) {
        int revents = await(t, POLLOUT, deadline_ns, err);
        if (revents < 0)
            return revents;
        if (revents == 0)
            return gon_fail(err, GON_E_LINK, "%s: took only %zu of %zu bytes in time", t->text,
                            done, size);
        ssize_t n = t->link.kind == LINK_SERIAL
                        ? write(t->fd, bytes + done, size - done)
                        : send(t->fd, bytes + done, size - done, MSG_NOSIGNAL);
        int rc = moved(t, n, revents, err);
        if (rc < 0)
            return rc;
        done += (size_t)rc;
        t->stats.bytes_out += (size_t)rc;
    }
    return 0;
}

static int stream_read(struct transport *t, void *data, size_t size, int64_t deadline_ns,
                       struct gon_error *err)
{
    for (;;) {
        int revents = await(t, POLLIN, deadline_ns, err);
        if (revents < 0)
            return revents;
        if (revents == 0)
            return gon_fail(err, GON_E_LINK, "%s: nothing came in time", t->text);
        int rc = moved(t, read(t->fd, data, size), revents, err);
        if (rc > 0)
            t->stats.bytes_in += (size_t)rc;
        if (rc)
            return rc;
    }
}

static int stream_drain(struct transport *t, int64_t quiet_ns, struct gon_error *err)
{
    char waste[1024];
    const int64_t give_up_ns = clk_now_ns(t->clk) + quiet_ns + TRANSPORT_BABBLE_NS;
    int dropped = 0;
    for (;;) {
        int revents = await(t, POLLIN, clk_now_ns(t->clk) + quiet_ns, err);
        if (revents <= 0)
            return revents < 0 ? revents : dropped;
        int rc = moved(t, read(t->fd, waste, sizeof waste), revents, err);
        if (rc < 0)
            return rc;
        transport_show(t, TAP_RECEIVED, waste, (size_t)rc);
        dropped += rc;
        t->stats.bytes_in += (size_t)rc;
        if (clk_now_ns(t->clk) >= give_up_ns)
            return gon_fail(err, GON_E_LINK, "%s: does not stop sending (%d bytes dropped)",
                            t->text, dropped);
    }
}

static void stream_free(struct transport *t)
{
    (void)t; // a shut one has nothing
}

const struct transport_ops transport_stream_ops = {stream_open,  stream_shut, stream_free,
                                                   stream_write, stream_read, stream_drain};
