// SPDX-License-Identifier: MIT
// The text that names a link, taken apart. Pure. Thread: any.
//
//   serial:PATH[?baud=115200&parity=N&stop=1]      tcp:HOST:PORT
//   modbus-rtu:PATH[?baud=115200&parity=E&stop=1]  modbus-tcp:HOST[:502]
//
// HOST is a name, an IPv4 address or an IPv6 address in [ ]. Always 8 data bits, no flow control.
#pragma once
#include "base/err.h"

#include <stdbool.h>

enum link_use { LINK_TEXT, LINK_MODBUS }; // which two of the four schemes are allowed

struct link {
    bool serial;     // else TCP
    char place[240]; // path, or host without [ ]
    char port[8];    // TCP: decimal, 1..65535
    int baud;        // serial: one of the standard rates, 1200..921600
    char parity;     // 'N', 'E', 'O'
    int stop;        // 1, 2
};

// GON_E_INPUT names the part that is wrong and what is allowed there.
int link_parse(const char *text, enum link_use use, struct link *ret_link, struct gon_error *err);
