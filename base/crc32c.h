// SPDX-License-Identifier: MIT
// CRC-32C (Castagnoli, RFC 3720 appendix B.4): the check value that each stored row carries.
#pragma once
#include <stddef.h>
#include <stdint.h>

// Continues from crc (0 to start): crc32c(crc32c(0, a, n), b, m) is the value of a followed by b.
uint32_t crc32c(uint32_t crc, const void *data, size_t size);
