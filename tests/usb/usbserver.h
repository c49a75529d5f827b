// SPDX-License-Identifier: MIT
// Serves sim/usbtmc to unmodified programs that use libusb: a testbed of libumockdev with usbfs
// nodes. The server's process and theirs run under umockdev-wrapper; theirs with UMOCKDEV_DIR set
// to usbserver_dir. Each device is any struct port that answers in lines of text.
//
// Two things make it work. A node is a link to a pty: libusb polls it for writing, which tcflow()
// switches, so that it wakes when a request is done; and closing the master is the hang-up of an
// unplugged device. And a node with its handler is there before its uevent is sent.
//
// libumockdev calls handlers on a thread of its own; a lock is held by each call here and there.
// What it cannot show: data toggles, packets of zero bytes as such, detaching a kernel driver.
#pragma once
#include "sim/usbtmc.h"

enum { USBSERVER_DEVICES = 4 };

struct usbserver;

struct usbserver *usbserver_new(void); // ends the process when there is no testbed
void usbserver_free(struct usbserver *s);
const char *usbserver_dir(const struct usbserver *s);
struct _UMockdevTestbed *usbserver_testbed(const struct usbserver *s); // for further devices

// A device, not plugged in yet. Borrows port and strings. Returns its number.
int usbserver_add(struct usbserver *s, struct port *port, const char *end,
                  const struct sim_usb_identity *identity);
// Bus and address must be new ones. Bus 1..99, address 1..127.
void usbserver_plug(struct usbserver *s, int device, int bus, int address);
void usbserver_unplug(struct usbserver *s, int device);

// For whoever changes the port or the model from outside the handlers.
void usbserver_lock(struct usbserver *s);
void usbserver_unlock(struct usbserver *s);
struct sim_usbtmc *usbserver_model(struct usbserver *s, int device);

// The loop: readable when requests came, when to step without them, and the step that completes
// what can be completed.
int usbserver_fd(const struct usbserver *s);
int64_t usbserver_next_ns(struct usbserver *s);
void usbserver_step(struct usbserver *s);
