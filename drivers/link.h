// SPDX-License-Identifier: MIT
// The text that names a link, taken apart. Pure. Thread: any.
//
//   serial:PATH[?baud=115200&parity=N&stop=1]      tcp:HOST:PORT
//   usbtmc:VID:PID[:SERIAL]
//   modbus-rtu:PATH[?baud=115200&parity=E&stop=1]  modbus-tcp:HOST[:502]
//
// HOST is a name, an IPv4 address or an IPv6 address in [ ]. Always 8 data bits, no flow control.
// VID and PID are four hexadecimal digits each, as lsusb shows them. PATH may be usb-VID:PID or
// usb-VID:PID:SERIAL: the USB adapter with these numbers, whatever its name in /dev is.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stdint.h>

enum link_use { LINK_TEXT, LINK_MODBUS }; // which of the schemes are allowed

enum link_kind { LINK_SERIAL, LINK_TCP, LINK_USBTMC };

struct link {
    enum link_kind kind;
    char place[240];          // path or usb-..., host without [ ], or the USB device's serial
                              // number ("": any)
    char port[8];             // TCP: decimal, 1..65535
    bool adapter;             // serial: by the numbers of its USB adapter
    uint16_t vendor, product; // USB
    int baud;                 // serial: one of the standard rates, 1200..921600
    char parity;              // 'N', 'E', 'O'
    int stop;                 // 1, 2
};

// GON_E_INPUT names the part that is wrong and what is allowed there.
int link_parse(const char *text, enum link_use use, struct link *ret_link, struct gon_error *err);
// Of a USB device or adapter; "": any.
const char *link_serial_number(const struct link *l);
