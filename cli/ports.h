// SPDX-License-Identifier: MIT
// Which serial ports this machine has, by the names that stay. Thread: any.
#pragma once
#include <stddef.h>

#define PORTS_BY_ID "/dev/serial/by-id"

// A sentence for somebody who looks for one: the names in the folder in order, as many as fit, or
// that there are none.
void ports_text(const char *folder, char *ret_text, size_t size);
