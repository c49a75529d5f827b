// SPDX-License-Identifier: MIT
// Checksums of text protocols, as a profile describes them (struct profile_checksum). Pure. The
// catalogue of CRCs (reveng.sourceforge.io/crc-catalogue) gives width, polynomial, initial value,
// reflections, final xor and the check value over "123456789". Thread: any.
#pragma once
#include "drivers/profile.h"

#include <stddef.h>

// Over size bytes; the low width bits count.
uint32_t checksum_of(const struct profile_checksum *c, const void *bytes, size_t size);

// Appends before and the checksum to a text of at most size bytes with its zero; for the raw forms
// ret_size says how long it is now, as its bytes may be zero. GON_E_INPUT: no room.
int checksum_append(const struct profile_checksum *c, char *text, size_t have, size_t size,
                    size_t *ret_size, struct gon_error *err);
// Checks and cuts it off. GON_E_LINK: missing or wrong ("got / expected").
int checksum_take(const struct profile_checksum *c, char *text, size_t have, size_t *ret_size,
                  struct gon_error *err);
