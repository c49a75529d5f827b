// SPDX-License-Identifier: MIT
// Bytes to and from one instrument: a serial port, a raw TCP connection or a USB device of the
// class USBTMC behind the same six calls.
//
//   serial:/dev/serial/by-id/usb-...?baud=115200&parity=N&stop=1
//                   over libserialport; termios where it refuses (ptys)
//   serial:usb-VID:PID:SERIAL?baud=...
//                   the same, by the numbers of the USB adapter, looked for at each opening
//   tcp:host:port   as ser2net and serial servers give
//   usbtmc:VID:PID:SERIAL
//                   over libusb; without SERIAL the only device with these numbers
//
// Nothing here blocks longer than its deadline: waiting is poll() on the descriptor and on the
// cancel token, I/O is non-blocking. Waits are cut into slices of at most 50 ms, and between slices
// clk_sleep_until(now) is called: a clock that does other work while it sleeps gets its turn. A
// hang-up is GON_E_GONE at once, never a timeout. Ports are locked (flock and TIOCEXCL); the second
// opener hears who has it. A pty has no parity: there it is not set. Thread: the one that opened
// it.
//
// Over USB a write is one message, and an answer ends where the device says so (transport_ended).
// What went wrong is mended before the next command (drivers/usbtmc_host.h). A USB device is found
// again by its serial number wherever it is plugged in; the kernel's usbtmc driver is detached
// while it is open. Claiming it, clearing a halt and resetting are calls of the kernel that cannot
// be cut into slices: with a dead device one may take 5 s.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"
#include "drivers/link_stats.h"
#include "drivers/tap.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct transport;
struct link;

// GON_E_INPUT: the link's text is wrong. GON_E_GONE: no such port or host. GON_E_REFUSED: in use.
// Connecting takes at most 2 s, in slices. The name of a host is looked up, which may take longer:
// use addresses where that matters.
int transport_open(const char *link, struct clk *clk, const struct cancel *cancel,
                   struct transport **ret_transport, struct gon_error *err);
// The same for a link that was parsed already; text is what it is called in messages.
int transport_open_parsed(const struct link *link, const char *text, struct clk *clk,
                          const struct cancel *cancel, struct transport **ret_transport,
                          struct gon_error *err);
void transport_close(struct transport *t); // flushes nothing: whoever needs OFF sends it before

// Closes and opens again by the same name (after GON_E_GONE). One try; the caller paces retries.
int transport_reopen(struct transport *t, struct gon_error *err);

// All of it within the deadline, or an error.
int transport_write(struct transport *t, const void *data, size_t size, int64_t deadline_ns,
                    struct gon_error *err);
// At least one byte, at most size: the count. GON_E_LINK at the deadline; reading on is possible
// and loses nothing. Over USB GON_E_LINK may also come earlier (stall, wrong tag), and 0 where a
// message ended with nothing more.
int transport_read(struct transport *t, void *data, size_t size, int64_t deadline_ns,
                   struct gon_error *err);
// Throws away what has arrived, until the line was silent for quiet_ns (0: only what is there).
// Returns the bytes dropped; GON_E_LINK when the line did not fall silent within quiet_ns and 2 s.
// Over USB the device is told to forget all commands and answers (INITIATE_CLEAR), with 0 only if
// something went wrong before. GON_E_DEVICE: it could not be cleared, and was reset.
int transport_drain(struct transport *t, int64_t quiet_ns, struct gon_error *err);
// USB: the device says where a message ends (EOM), and the last read got as far. Never on a line of
// plain bytes.
bool transport_framed(const struct transport *t);
bool transport_ended(const struct transport *t);

const char *transport_link(const struct transport *t);
const struct link_stats *transport_stats(const struct transport *t);
// From now on who is told of every byte (over USB: of messages, without their headers); borrowed.
// NULL: nobody, as at first.
void transport_tap(struct transport *t, const struct tap *tap);

// --- for the other modules of this layer ---------------------------------------------------------
int transport_fd(const struct transport *t); // -1: hung up or not reopened; USB
struct clk *transport_clk(const struct transport *t);
// What must be sent whatever was cancelled (OFF, STOP) goes with NULL. Returns the token before.
const struct cancel *transport_mind(struct transport *t, const struct cancel *cancel);
const struct cancel *transport_cancel(const struct transport *t);
struct link_stats *transport_book(struct transport *t); // what I/O elsewhere has to enter
// What I/O elsewhere moved, for the tap; nothing happens without one.
bool transport_tapped(const struct transport *t);
void transport_show(const struct transport *t, enum tap_way way, const void *bytes, size_t size);
// Whoever did I/O on transport_fd and met an error that means "gone" says so: closes, returns
// GON_E_GONE.
int transport_hung_up(struct transport *t, int error, struct gon_error *err);
