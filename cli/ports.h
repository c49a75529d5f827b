// SPDX-License-Identifier: MIT
// Which serial ports this machine has, by the names that stay. Thread: any.
#pragma once
#include <stddef.h>

struct adapter;

#define PORTS_BY_ID "/dev/serial/by-id"

// A sentence for somebody who looks for one: the names in the folder in order, then each USB
// adapter as a link names it by its numbers ("usb-0403:6001:A50285BI (/dev/ttyUSB0)"), as many as
// fit; or that there are none. size is at least 60.
void ports_text(const char *folder, const struct adapter *adapters, int count, char *ret_text,
                size_t size);
