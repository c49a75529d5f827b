// SPDX-License-Identifier: MIT
// Serial ports that are USB adapters, by the numbers that stay when the names in /dev change. The
// kernel's list (sysfs, by libserialport) is read anew at each call; nothing is opened. Any thread.
#pragma once
#include "base/err.h"
#include "drivers/link.h"

#include <stddef.h>
#include <stdint.h>

enum { ADAPTERS_MOST = 32, ADAPTER_LINK = 160 };

struct adapter {
    char name[48]; // "/dev/ttyUSB0"
    uint16_t vendor, product;
    char serial[120]; // "": it has none
};

// How many are plugged in, in the order of their names; of more than ADAPTERS_MOST some.
int transport_adapters(struct adapter ret_adapters[ADAPTERS_MOST]);
// "usb-0403:6001:A50285BI": what finds it, after serial: or modbus-rtu:.
void transport_adapter_link(const struct adapter *a, char ret_text[ADAPTER_LINK]);

// The name in /dev of the one port that a link with adapter numbers means. GON_E_GONE: not plugged
// in; GON_E_INPUT: several are alike. Both tell which there are.
int transport_adapter_find(const struct link *link, char *ret_name, size_t size,
                           struct gon_error *err);
