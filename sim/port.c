// SPDX-License-Identifier: MIT
#include "sim/port.h"

#include <assert.h>
#include <string.h>

void port_init(struct port *p, const struct port_ops *ops)
{
    memset(p, 0, sizeof *p);
    p->ops = ops;
    p->tick_ns = PORT_NEVER;
}

static void tick(struct port *p, int64_t t_ns)
{
    while (p->tick_ns <= t_ns) {
        int64_t at_ns = p->tick_ns;
        p->tick_ns = PORT_NEVER;
        p->ops->tick(p, at_ns);
    }
}

void port_feed(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    tick(p, t_ns);
    if (size > 0)
        p->ops->feed(p, bytes, size, t_ns);
}

int64_t port_next_ns(const struct port *p)
{
    int64_t due_ns = p->count > 0 ? p->queue[p->first].due_ns : PORT_NEVER;
    return p->tick_ns < due_ns ? p->tick_ns : due_ns;
}

size_t port_take(struct port *p, int64_t t_ns, uint8_t bytes[PORT_REPLY_MOST], int64_t *ret_due_ns)
{
    tick(p, t_ns);
    if (p->count == 0 || p->queue[p->first].due_ns > t_ns)
        return 0;
    const struct port_reply *r = &p->queue[p->first];
    memcpy(bytes, r->bytes, r->size);
    if (ret_due_ns)
        *ret_due_ns = r->due_ns;
    p->first = (p->first + 1) % PORT_QUEUE;
    p->count--;
    p->frames_out++;
    return r->size;
}

void port_hangup(struct port *p)
{
    p->count = 0;
    p->tick_ns = PORT_NEVER;
    p->ops->hangup(p);
}

void port_send(struct port *p, const void *bytes, size_t size, int64_t due_ns)
{
    assert(size > 0 && size <= PORT_REPLY_MOST);
    if (p->mute || p->drop > 0 || p->count == PORT_QUEUE) {
        p->drop -= !p->mute && p->drop > 0;
        p->lost++;
        return;
    }
    due_ns += p->delay_ns;
    p->delay_ns = 0;
    if (p->count > 0) {
        int64_t last_ns = p->queue[(p->first + p->count - 1) % PORT_QUEUE].due_ns;
        due_ns = due_ns > last_ns ? due_ns : last_ns;
    }
    struct port_reply *r = &p->queue[(p->first + p->count++) % PORT_QUEUE];
    r->due_ns = due_ns;
    r->size = size;
    memcpy(r->bytes, bytes, size);
}
