// SPDX-License-Identifier: MIT
// Plays the instrument of one golden entry on a pseudo-terminal, so that the production code talks
// to it as to any port: it compares every byte that arrives with those shown and then sends the
// answer shown. A thread of its own; the other calls: the thread of whoever started it.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { GOLDEN_BYTES = 600 };

struct golden_bytes {
    uint8_t byte[GOLDEN_BYTES];
    size_t size;
};

// The CRC of an RTU frame behind it, low byte first; nothing where there is no room.
void golden_bytes_add_crc(struct golden_bytes *b);
// Text with terminators and the like as \r or \x07; hex: "07 10 62". Cut off where size ends.
void golden_bytes_show(const struct golden_bytes *b, bool hex, char *ret_text, size_t size);

// Terminators included.
struct golden_script {
    struct golden_bytes sent, received; // no bytes received: it stays silent
    bool rtu;
    int shown; // rtu: which request is the one shown, from 0; writes before and behind it are
               // acknowledged, as the edges of command bits are several
};

struct golden_peer;

int golden_peer_start(const struct golden_script *script, struct golden_peer **ret_peer,
                      struct gon_error *err);
const char *golden_peer_path(const struct golden_peer *peer); // of the port to open
// Waits a moment for what is still under way, then ends it. GON_E_INPUT: "got ... / expected ... /
// at byte n" when something else was sent.
int golden_peer_finish(struct golden_peer *peer, struct gon_error *err);
