// SPDX-License-Identifier: MIT
#include "drivers/modbus_relay.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/types.h>
#include <unistd.h>

#define WRITE_MS 200 // for a request to leave

struct modbus_relay {
    int line, inner, outer; // inner: libmodbus' end of the pair
    pthread_t thread;
    struct modbus_relay_bytes sent, received; // the thread's until it has ended
};

static void keep(struct modbus_relay_bytes *b, const uint8_t *bytes, size_t size)
{
    const size_t room = sizeof b->byte - b->size, kept = size < room ? size : room;
    memcpy(b->byte + b->size, bytes, kept);
    b->size += kept;
}

// False: the line takes no more.
static bool put(struct modbus_relay *r, const uint8_t *bytes, size_t size)
{
    for (size_t done = 0; done < size;) {
        const ssize_t n = write(r->line, bytes + done, size - done);
        struct pollfd p = {r->line, POLLOUT, 0};
        if (n > 0)
            done += (size_t)n;
        else if (n == 0 || (errno != EAGAIN && errno != EINTR) || poll(&p, 1, WRITE_MS) == 0)
            return false;
    }
    keep(&r->sent, bytes, size);
    return true;
}

// False: it is over.
static bool pass_out(struct modbus_relay *r, bool *line_is_there)
{
    uint8_t bytes[300];
    const ssize_t n = read(r->outer, bytes, sizeof bytes);
    if (n <= 0)
        return n < 0 && errno == EINTR;
    if (*line_is_there && !put(r, bytes, (size_t)n)) {
        shutdown(r->outer, SHUT_WR);
        *line_is_there = false;
    }
    return true;
}

static void pass_in(struct modbus_relay *r, bool *line_is_there)
{
    uint8_t bytes[300];
    const ssize_t n = read(r->line, bytes, sizeof bytes);
    if (n > 0) {
        keep(&r->received, bytes, (size_t)n);
        send(r->outer, bytes, (size_t)n, MSG_NOSIGNAL);
    } else if (n == 0 || (errno != EAGAIN && errno != EINTR)) {
        shutdown(r->outer, SHUT_WR);
        *line_is_there = false;
    }
}

static void *relay(void *arg)
{
    struct modbus_relay *r = arg;
    bool line_is_there = true, going = true;
    while (going) {
        struct pollfd p[2] = {{r->outer, POLLIN, 0}, {line_is_there ? r->line : -1, POLLIN, 0}};
        if (poll(p, 2, -1) < 0 && errno != EINTR)
            break;
        if (p[1].revents)
            pass_in(r, &line_is_there);
        if (p[0].revents)
            going = pass_out(r, &line_is_there);
    }
    return NULL;
}

struct modbus_relay *modbus_relay_start(int line)
{
    struct modbus_relay *r = calloc(1, sizeof *r);
    int pair[2];
    if (!r || socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) < 0) {
        free(r);
        return NULL;
    }
    const bool fits = pair[0] < FD_SETSIZE; // libmodbus waits with select()
    r->line = line;
    r->inner = pair[0];
    r->outer = pair[1];
    if (fits && pthread_create(&r->thread, NULL, relay, r) == 0)
        return r;
    close(r->inner);
    close(r->outer);
    free(r);
    return NULL;
}

int modbus_relay_fd(const struct modbus_relay *r)
{
    return r->inner;
}

void modbus_relay_end(struct modbus_relay *r, struct modbus_relay_bytes *ret_sent,
                      struct modbus_relay_bytes *ret_received)
{
    close(r->inner); // the thread sees the end
    pthread_join(r->thread, NULL);
    close(r->outer);
    *ret_sent = r->sent;
    *ret_received = r->received;
    free(r);
}
