// SPDX-License-Identifier: MIT
// The two kinds of descriptors that a transport opens. Both are non-blocking and closed on exec;
// what is done with them afterwards is the same. Inside this layer. Thread: the transport's.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"
#include "drivers/link.h"

#include <stdbool.h>
#include <stdint.h>

struct serial_port;

// Opens, locks and configures. A path may be a symbolic link (by-id): it is resolved lexically,
// because libserialport 0.1.1 knows only names directly in /dev. The numbers of a USB adapter are
// looked for among those that are plugged in now. GON_E_REFUSED: in use; GON_E_GONE: not there;
// GON_E_INPUT: several adapters are alike.
int transport_serial_open(const struct link *link, struct serial_port **ret_port,
                          struct gon_error *err);
void transport_serial_close(struct serial_port *p);
int transport_serial_fd(const struct serial_port *p);
bool transport_serial_by_library(const struct serial_port *p); // libserialport, not the fallback

// A connected socket: TCP_NODELAY, keepalive and TCP_USER_TIMEOUT, so that a silent peer is
// noticed.
int transport_tcp_connect(const struct link *link, struct clk *clk, const struct cancel *cancel,
                          int64_t deadline_ns, struct gon_error *err);

// One slice of waiting for events on fd: > 0 the revents, 0 the time is up or the slice is,
// negative GON_E_CANCELED or GON_E_SYSTEM. Never longer than 50 ms.
int transport_slice(int fd, short events, int64_t until_ns, struct clk *clk,
                    const struct cancel *cancel);
