// SPDX-License-Identifier: MIT
// A port on a real wire: a pty or a TCP listener on 127.0.0.1. The wire moves bytes and keeps their
// times: with speed enforced, bytes arrive and leave no faster than the line's baud allows,
// measured on absolute times. One client at a time; the next one on TCP is closed at once. Thread:
// the poll loop's.
//
// The loop calls wire_poll_fds to fill its poll set, wire_next_ns for its timeout, and wire_serve
// after each poll; nothing blocks.
#pragma once
#include "base/err.h"
#include "sim/port.h"

#include <poll.h>
#include <stdbool.h>

enum { WIRE_FDS = 2, WIRE_BUFFER = 4096 };

struct wire;

struct wire_ops {
    int (*open)(struct wire *w, struct gon_error *err);
    void (*close)(struct wire *w); // as pulling the plug: the client sees a hang-up
    int (*fds)(struct wire *w, struct pollfd fds[WIRE_FDS]); // how many
    // Takes care of comings and goings; true while a client may be read and written.
    bool (*attend)(struct wire *w, const struct pollfd *fds);
    int (*client)(const struct wire *w); // descriptor; -1: none
    long (*baud)(const struct wire *w);  // of the client; 0: not a matter of this wire
    void (*lost)(struct wire *w);        // reading said that the client is gone
};

struct wire {
    const struct wire_ops *ops; // first
    const char *name;
    struct port *port;
    bool plugged;
    bool enforce; // baud timing
    int bits;     // of a character on the line
    uint64_t clients, bytes_in, bytes_out;
    char address[600]; // pty: its symlink; TCP: "127.0.0.1:port"
    // bytes on the line towards the instrument, and back
    uint8_t rx[WIRE_BUFFER], tx[WIRE_BUFFER];
    size_t rx_size, tx_size;
    int64_t rx_free_ns, tx_free_ns; // when the last byte has passed
    int64_t rx_due_ns, tx_due_ns;   // when the next step is
    // of the kinds
    int fd[3];
    bool vacant;
    long port_number;
};

// A pty published as a symlink at path; its baud is what the client set.
void wire_pty_init(struct wire *w, const char *name, struct port *port, const char *path);
// A listener on 127.0.0.1 with a port that the system chooses (the same again after unplugging).
void wire_tcp_init(struct wire *w, const char *name, struct port *port);

int wire_plug(struct wire *w, struct gon_error *err);
void wire_unplug(struct wire *w);
int wire_poll_fds(struct wire *w, struct pollfd fds[WIRE_FDS]);
void wire_serve(struct wire *w, const struct pollfd *fds, int64_t t_ns);
int64_t wire_next_ns(const struct wire *w); // PORT_NEVER
int64_t wire_char_ns(const struct wire *w); // a character's time on the line now; 0: not enforced

// For the kinds: the client is gone.
void wire_hangup(struct wire *w);
