// SPDX-License-Identifier: MIT
// Private to campaign/store*.c: a reading as the bytes that its check value covers.
#pragma once
#include "campaign/store.h"

enum { STORE_ROW_BYTES = 3 * 4 + 8 + 2 * 4 + 4 * 8 + 2 * 4 + 4 };

void store_row_bytes(const struct store_reading *r, unsigned char bytes[STORE_ROW_BYTES]);
uint32_t store_row_crc(const struct store_reading *r);
// 0, or GON_E_INPUT for what must never be stored.
int store_row_check(const struct store_reading *r, struct gon_error *err);
