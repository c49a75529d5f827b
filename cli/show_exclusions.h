// SPDX-License-Identifier: MIT
// Which readings of a campaign do not count, and why, for gonio show.
#pragma once
#include "campaign/store.h"

struct json_t; // of jansson

struct exclusion { // what holds of a reading now
    int64_t id, t_utc_ms;
    int sweep, point, attempt;
    char what[12];
    char *reason, *who;
};

struct exclusions {
    struct exclusion *list; // by sweep, point, attempt; none that was restored
    int count;
};

int exclusions_read(struct store *s, struct exclusions *ret_exclusions, struct gon_error *err);
void exclusions_clear(struct exclusions *x); // NULL is fine

// Of a reading; NULL: nothing was decided of it, or it was restored.
const struct exclusion *exclusions_find(const struct exclusions *x, const struct store_reading *r);
// A line for those that were decided together: "excluded  sweep 1, points 3 to 5: dust (Max, ...)".
void exclusions_print(const struct exclusions *x);
// [{"sweep", "point", "attempt", "what", "reason", "who", "t_utc_ms"}]
struct json_t *exclusions_json(const struct exclusions *x);
