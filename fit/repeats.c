// SPDX-License-Identifier: MIT
#include "fit/repeats.h"

#include "fit/fit.h"

#include <stdlib.h>
#include <string.h>

static uint64_t bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

// Multiply and fold: every bit of every column reaches the low bits that choose the place.
static uint64_t hash_row(const double *const column[], int columns, size_t row)
{
    uint64_t h = 0;
    for (int c = 0; c < columns; c++) {
        h = (h ^ bits_of(column[c][row])) * 0x9e3779b97f4a7c15u;
        h ^= h >> 29;
    }
    return h;
}

static bool rows_equal(const double *const column[], int columns, size_t a, size_t b)
{
    for (int c = 0; c < columns; c++)
        if (bits_of(column[c][a]) != bits_of(column[c][b]))
            return false;
    return true;
}

// A table of first rows with open addressing, at most half full: the row's number from 1 on (0 is
// free) and, above it, half of its hash, so that rows are only read when they are the same. Places
// lie all over memory, so those of a batch are asked for before the first of them is looked at;
// while the table is new every one of them may cost the system a page, so the slices are short.
enum { BATCH = 32 };

struct table {
    uint64_t *place;
    size_t mask;
    const double *const *column;
    int columns;
};

static uint64_t *find(const struct table *t, uint64_t hash, size_t row)
{
    size_t at = hash & t->mask;
    while (t->place[at] != 0 &&
           (t->place[at] >> 32 != hash >> 32 ||
            !rows_equal(t->column, t->columns, (uint32_t)t->place[at] - 1, row)))
        at = (at + 1) & t->mask;
    return &t->place[at];
}

static void hash_batch(const struct table *t, size_t row, size_t count, uint64_t *ret_hash)
{
    for (size_t j = 0; j < count; j++) {
        ret_hash[j] = hash_row(t->column, t->columns, row + j);
        __builtin_prefetch(&t->place[ret_hash[j] & t->mask], 1);
    }
}

int repeats_find(const double *const column[], int columns, size_t count,
                 struct fit_control *control, uint32_t *ret_group, size_t *ret_groups)
{
    size_t places = 16, groups = 0;
    uint64_t hash[BATCH];
    while (places < 2 * count)
        places *= 2;
    struct table t = {count <= REPEATS_MOST ? calloc(places, sizeof *t.place) : NULL, places - 1,
                      column, columns};
    if (!t.place)
        return FIT_E_MEMORY;
    for (size_t i = 0; i < count; i++) {
        if (i % (CONTROL_SLICE / 32) == 0 && control_ask(control)) {
            free(t.place);
            return FIT_E_CANCELED;
        }
        if (i % BATCH == 0)
            hash_batch(&t, i, count - i < BATCH ? count - i : BATCH, hash);
        uint64_t *place = find(&t, hash[i % BATCH], i);
        if (*place == 0) {
            *place = hash[i % BATCH] >> 32 << 32 | (i + 1);
            ret_group[i] = (uint32_t)groups++;
        } else {
            ret_group[i] = ret_group[(uint32_t)*place - 1];
        }
    }
    free(t.place);
    *ret_groups = groups;
    return 0;
}
