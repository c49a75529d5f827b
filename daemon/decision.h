// SPDX-License-Identifier: MIT
// What somebody decides about readings of a run (campaign/store_exclude.h), on its way from a
// request to the store thread.
#pragma once
#include "base/err.h"

#include <stddef.h>
#include <stdint.h>

struct store;

enum decision_verb { DECISION_EXCLUDE, DECISION_RESTORE, DECISION_REMEASURE };

struct decision {
    enum decision_verb verb;
    int sweep;    // DECISION_REMEASURE
    char *which;  // the others: readings, as campaign/reading_pick.h
    char *reason; // NULL: none was given
    char *who;
};

// Of a request's body: {"do": "exclude"|"restore", "readings": text, "reason": text} or {"do":
// "remeasure", "sweep": number, "reason": text}. GON_E_INPUT: not that; the reason is the store's
// to judge.
int decision_parse(const char *body, size_t size, const char *who, struct decision **ret_decision,
                   struct gon_error *err);
// Writes it; returns how many readings it was about, or the store's error.
int decision_make(const struct decision *d, struct store *s, int64_t t_utc_ms,
                  struct gon_error *err);
void decision_free(void *decision); // NULL is fine
