// SPDX-License-Identifier: MIT
// What an instrument says it is, as text. Pure. Thread: any.
#pragma once
#include <stddef.h>

// The serial number in it: the third field of an *IDN? answer without "s/n" before it, or the word
// after "serial ". "" when there is none.
void identity_serial(const char *identity, char *ret_serial, size_t size);
