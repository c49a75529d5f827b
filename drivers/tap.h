// SPDX-License-Identifier: MIT
// Who listens in on a link: is given every byte as it went over the wire, terminators and frames
// included, also what was thrown away because nobody wanted it. Changes nothing. Thread: the
// transport's, from within its calls.
#pragma once
#include <stddef.h>

// TAP_SENT: one call is one command or request; TAP_RECEIVED: as much as came at once.
enum tap_way { TAP_SENT, TAP_RECEIVED };

struct tap {
    void (*take)(void *ctx, enum tap_way way, const void *bytes, size_t size);
    void *ctx;
};
