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

// A table of first rows (numbered from 1; 0 is free) with open addressing, at most half full. While
// it is new, every row may cost the system a page: the slices are short.
int repeats_find(const double *const column[], int columns, size_t count,
                 struct fit_control *control, uint32_t *ret_group, size_t *ret_groups)
{
    size_t places = 16, groups = 0;
    while (places < 2 * count)
        places *= 2;
    uint32_t *table = count <= REPEATS_MOST ? calloc(places, sizeof *table) : NULL;
    if (!table)
        return FIT_E_MEMORY;
    for (size_t i = 0; i < count; i++) {
        if (i % (CONTROL_SLICE / 32) == 0 && control_ask(control)) {
            free(table);
            return FIT_E_CANCELED;
        }
        size_t at = hash_row(column, columns, i) & (places - 1);
        while (table[at] != 0 && !rows_equal(column, columns, table[at] - 1, i))
            at = (at + 1) & (places - 1);
        if (table[at] == 0) {
            table[at] = (uint32_t)i + 1;
            ret_group[i] = (uint32_t)groups++;
        } else {
            ret_group[i] = ret_group[table[at] - 1];
        }
    }
    free(table);
    *ret_groups = groups;
    return 0;
}
