// SPDX-License-Identifier: MIT
#include "sim/wire.h"

#include <errno.h>
#include <string.h>
#include <unistd.h>

#define CHUNK_NS 1000000 // bytes leave together when they take no longer than this

int64_t wire_char_ns(const struct wire *w)
{
    long baud = w->enforce ? w->ops->baud(w) : 0;
    return baud > 0 ? (int64_t)w->bits * 1000000000 / baud : 0;
}

int wire_plug(struct wire *w, struct gon_error *err)
{
    if (w->plugged)
        return 0;
    int rc = w->ops->open(w, err);
    if (rc)
        return gon_prefix(err, "wire %s", w->name);
    w->plugged = true;
    return 0;
}

void wire_hangup(struct wire *w)
{
    w->rx_size = w->tx_size = 0;
    w->rx_due_ns = w->tx_due_ns = PORT_NEVER;
    port_hangup(w->port);
}

void wire_unplug(struct wire *w)
{
    if (!w->plugged)
        return;
    w->plugged = false;
    w->ops->close(w);
    wire_hangup(w);
}

int wire_poll_fds(struct wire *w, struct pollfd fds[WIRE_FDS])
{
    return w->plugged ? w->ops->fds(w, fds) : 0;
}

int64_t wire_next_ns(const struct wire *w)
{
    int64_t due_ns = port_next_ns(w->port);
    if (w->tx_size > 0) // the line is busy: the port's next reply waits
        due_ns = w->port->tick_ns < w->tx_due_ns ? w->port->tick_ns : w->tx_due_ns;
    return w->rx_size > 0 && w->rx_due_ns < due_ns ? w->rx_due_ns : due_ns;
}

// Bytes that the client wrote start over the line as soon as it is free.
static void receive(struct wire *w, int64_t t_ns)
{
    size_t room = sizeof w->rx - w->rx_size;
    ssize_t n = room > 0 ? read(w->ops->client(w), w->rx + w->rx_size, room) : 0;
    if (n < 0 && (errno == EAGAIN || errno == EINTR))
        return;
    if (n <= 0 && room > 0) {
        w->ops->lost(w);
        return;
    }
    int64_t begin_ns = w->rx_free_ns > t_ns ? w->rx_free_ns : t_ns;
    w->rx_size += (size_t)n;
    w->bytes_in += (uint64_t)n;
    w->rx_free_ns = w->rx_due_ns = begin_ns + n * wire_char_ns(w);
}

static void deliver(struct wire *w, int64_t t_ns)
{
    if (w->rx_size == 0 || w->rx_due_ns > t_ns)
        return;
    size_t size = w->rx_size;
    w->rx_size = 0;
    port_feed(w->port, w->rx, size, w->rx_due_ns);
}

// A chunk leaves when its last character would have passed.
static void plan_chunk(struct wire *w, int64_t from_ns)
{
    int64_t char_ns = wire_char_ns(w);
    int64_t chunk = char_ns > 0 && char_ns < CHUNK_NS ? CHUNK_NS / char_ns : 1;
    if (char_ns == 0 || chunk > (int64_t)w->tx_size)
        chunk = (int64_t)w->tx_size;
    w->tx_due_ns = from_ns + chunk * char_ns;
}

static void load(struct wire *w, int64_t t_ns)
{
    uint8_t reply[PORT_REPLY_MOST];
    int64_t due_ns;
    size_t size = port_take(w->port, t_ns, reply, &due_ns);
    if (size == 0)
        return;
    memcpy(w->tx, reply, size);
    w->tx_size = size;
    if (due_ns > w->tx_free_ns)
        w->tx_free_ns = due_ns;
    plan_chunk(w, w->tx_free_ns);
}

static void send_due(struct wire *w, int64_t t_ns)
{
    int64_t char_ns = wire_char_ns(w);
    while (w->tx_size > 0 && w->tx_due_ns <= t_ns) {
        size_t size = w->tx_size;
        if (char_ns > 0 && (w->tx_due_ns - w->tx_free_ns) / char_ns < (int64_t)size)
            size = (size_t)((w->tx_due_ns - w->tx_free_ns) / char_ns);
        int fd = w->ops->client(w);
        ssize_t n = fd >= 0 ? write(fd, w->tx, size) : (ssize_t)size; // nobody hears it
        if (n <= 0) {
            w->tx_due_ns = t_ns + CHUNK_NS; // full: again in a moment
            w->tx_free_ns = t_ns;
            return;
        }
        w->bytes_out += (uint64_t)n;
        w->tx_size -= (size_t)n;
        memmove(w->tx, w->tx + n, w->tx_size);
        w->tx_free_ns = w->tx_due_ns;
        plan_chunk(w, w->tx_free_ns);
    }
}

void wire_serve(struct wire *w, const struct pollfd *fds, int64_t t_ns)
{
    if (w->plugged && w->ops->attend(w, fds))
        receive(w, t_ns);
    deliver(w, t_ns);
    do {
        send_due(w, t_ns);
        if (w->tx_size == 0)
            load(w, t_ns);
    } while (w->tx_size > 0 && w->tx_due_ns <= t_ns);
}
