// SPDX-License-Identifier: MIT
// USB serial adapters beside the devices of usbserver, for unmodified programs that use
// libserialport: /dev/ttyUSB0 ... in its testbed, each a link to a pty that somebody else serves,
// with the entries of sysfs by which an adapter is known, and the modem's lines, which a pty has
// not. A port goes when its pty hangs up and it is unplugged here. Thread: the server's.
#pragma once
#include "tests/usb/usbserver.h"

enum { TTYSERVER_PORTS = 8 };

struct ttyserver;

struct tty_adapter {
    int bus, address; // as usbserver_plug wants them
    unsigned vendor, product;
    const char *serial; // "-": none
    const char *pty;    // "/dev/pts/7"
};

struct ttyserver *ttyserver_new(struct usbserver *s); // borrows it; ends the process without memory
void ttyserver_free(struct ttyserver *t);

// As /dev/ttyUSB<number>.
void ttyserver_plug(struct ttyserver *t, int number, const struct tty_adapter *a);
void ttyserver_unplug(struct ttyserver *t, int number);
// How often the modem's lines were asked or set since it was plugged in: libserialport does so when
// it opens a port.
unsigned ttyserver_seen(struct ttyserver *t, int number);
