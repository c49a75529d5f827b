// SPDX-License-Identifier: MIT
// Stands between libmodbus and the line for the length of one request, so that its frames can be
// seen: libmodbus moves bytes itself and does not say which. A thread passes them on, in both
// directions, and keeps them. It lives no longer than the request, so that nothing can wait in it
// that came too late: that stays on the line and is drained there as always. A line that hangs up
// shows as end of file. Inside this layer; the calls: one thread.
#pragma once
#include <stddef.h>
#include <stdint.h>

struct modbus_relay;

struct modbus_relay_bytes {
    uint8_t byte[600]; // two of the longest frames; what comes beyond is passed on and not kept
    size_t size;
};

// The line is borrowed. NULL: no memory, descriptor or thread for it.
struct modbus_relay *modbus_relay_start(int line);
int modbus_relay_fd(const struct modbus_relay *r); // what libmodbus gets
void modbus_relay_end(struct modbus_relay *r, struct modbus_relay_bytes *ret_sent,
                      struct modbus_relay_bytes *ret_received);
