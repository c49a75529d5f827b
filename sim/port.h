// SPDX-License-Identifier: MIT
// One end of a line with an instrument behind it, as bytes and times: what came in is fed with the
// time of its last byte; what goes out waits in a queue until it is due. No I/O. The wires
// (sim/wire), unit tests and a simulation in virtual time all drive ports through these calls.
// Faults of a link that are not a matter of its wire (mute, dropped and late replies) live here.
// Thread: one.
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define PORT_NEVER INT64_MAX
enum { PORT_REPLY_MOST = 300, PORT_QUEUE = 32 };

struct port;

struct port_ops { // all three are required
    void (*feed)(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns);
    void (*tick)(struct port *p, int64_t t_ns); // at or after port->tick_ns
    void (*hangup)(struct port *p);             // the client is gone: forget what it began
};

struct port_reply {
    int64_t due_ns;
    size_t size;
    uint8_t bytes[PORT_REPLY_MOST];
};

struct port {
    const struct port_ops *ops;
    int64_t tick_ns;  // when the instrument wants tick; PORT_NEVER
    int first, count; // ring of replies
    struct port_reply queue[PORT_QUEUE];
    // faults
    bool mute;        // commands are carried out, nothing is answered
    unsigned drop;    // that many next replies are lost
    int64_t delay_ns; // of the next reply, once
    uint64_t frames_in, frames_out, lost;
};

void port_init(struct port *p, const struct port_ops *ops);
void port_feed(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns);
int64_t port_next_ns(const struct port *p); // when port_take may have something to do; PORT_NEVER
// Carries out what is due at t_ns and takes the reply whose time has come: its size, or 0.
// ret_due_ns (NULL is fine) gets that time.
size_t port_take(struct port *p, int64_t t_ns, uint8_t bytes[PORT_REPLY_MOST], int64_t *ret_due_ns);
void port_hangup(struct port *p); // also drops the replies that wait

// For instruments: queues a reply (at most PORT_REPLY_MOST bytes), never before an earlier one.
void port_send(struct port *p, const void *bytes, size_t size, int64_t due_ns);
