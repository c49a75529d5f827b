// SPDX-License-Identifier: MIT
// What has named positions: a shutter ("open", "closed"), a filter wheel ("1" ... "6"), a chopper
// that runs or stands. Made by by_profile.h. Thread: instrument.
//
// It is read before it is told anything: what is there already is told nothing, and one that can
// only change over is never told before its state is known, also when the answer to the last
// command was lost. What it was told is read back until it is there.
#pragma once
#include "base/err.h"

#include <stdbool.h>
#include <stddef.h>

struct link_stats;
struct selector;

enum { SELECTOR_ELSEWHERE = -1 }; // at none of its positions

struct selector_ops {
    // Also sends what has to be set once after the power came on.
    int (*identify)(struct selector *z, char *ret_text, size_t size, struct gon_error *err);
    int (*positions)(struct selector *z);
    const char *(*name)(struct selector *z, int position); // 0 .. positions - 1
    int (*safe)(struct selector *z);                       // SELECTOR_ELSEWHERE: none is
    // Asked now: a position, or SELECTOR_ELSEWHERE. ret_moving may be NULL.
    int (*where)(struct selector *z, int *ret_position, bool *ret_moving, struct gon_error *err);
    // Returns when it is there, at most the profile's timeout_s later (twice that after a lost
    // answer). GON_E_DEVICE: it does not go there; GON_E_LINK: nobody knows where it is.
    int (*go)(struct selector *z, int position, struct gon_error *err);
    int (*reopen)(struct selector *z, struct gon_error *err);
    const struct link_stats *(*stats)(const struct selector *z); // NULL: it has no link
    void (*free)(struct selector *z);
};

struct selector {
    const struct selector_ops *ops; // first member of each driver's own struct
};

// The position of that name; SELECTOR_ELSEWHERE: there is none.
int selector_find(struct selector *z, const char *name);
