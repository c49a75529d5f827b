// SPDX-License-Identifier: MIT
// What an instrument says it is, as text. Pure. Thread: any.
#pragma once
#include "base/err.h"

#include <stddef.h>

// The serial number in it: the third field of an *IDN? answer without "s/n" before it, or the word
// after "serial ". "" when there is none.
void identity_serial(const char *identity, char *ret_serial, size_t size);

// Whether the one that says now may be the one that said before: both give the same serial number,
// or the former gave none (also "": nothing was said yet). GON_E_DEVICE: it is another one; the
// text tells both numbers and what to do.
int identity_same(const char *before, const char *now, struct gon_error *err);
