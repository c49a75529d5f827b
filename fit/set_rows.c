// SPDX-License-Identifier: MIT
#include "fit/set_rows.h"

#include "fit/pool.h"

#include <math.h>
#include <stdlib.h>

enum { ALIGNMENT = 64 };

// Directions and states first, then sqrt(g) and f.
static int arrays_of(struct set_rows *r, double **ret_array[SET_ARRAYS])
{
    int count = 0;
    ret_array[count++] = &r->tan2_theta;
    ret_array[count++] = &r->cos_beta;
    ret_array[count++] = &r->spec;
    ret_array[count++] = &r->diffuse;
    for (int c = 0; c < SET_CHANNELS && r->channel[c]; c++)
        ret_array[count++] = &r->channel[c];
    ret_array[count++] = &r->root_g;
    ret_array[count++] = &r->f;
    return count;
}

int set_rows_new(size_t count, bool polarised, struct set_rows *ret_rows, void **ret_memory)
{
    double here;
    struct set_rows r = {.count = count};
    r.padded = (count + SET_LANES - 1) / SET_LANES * SET_LANES;
    for (int c = 0; c < SET_CHANNELS; c++)
        r.channel[c] = polarised ? &here : NULL;
    double **array[SET_ARRAYS];
    int arrays = arrays_of(&r, array);
    if (r.padded > SIZE_MAX / sizeof(double) / SET_ARRAYS)
        return FIT_E_MEMORY;
    double *memory = aligned_alloc(ALIGNMENT, r.padded * (size_t)arrays * sizeof *memory);
    if (!memory)
        return FIT_E_MEMORY;
    for (int a = 0; a < arrays; a++) {
        *array[a] = memory + (size_t)a * r.padded;
        for (size_t i = count; i < r.padded; i++)
            (*array[a])[i] = array[a] == &r.cos_beta;
    }
    *ret_rows = r;
    *ret_memory = memory;
    return 0;
}

int set_rows_geometry(const struct set_rows *rows, const double *ret_array[SET_ARRAYS])
{
    struct set_rows r = *rows;
    double **array[SET_ARRAYS];
    int count = arrays_of(&r, array) - 2;
    for (int a = 0; a < count; a++)
        ret_array[a] = *array[a];
    return count;
}

void set_rows_copy(const struct set_rows *from, size_t i, struct set_rows *to, size_t j)
{
    struct set_rows source = *from;
    double **read[SET_ARRAYS], **write[SET_ARRAYS];
    int count = arrays_of(&source, read);
    arrays_of(to, write);
    for (int a = 0; a < count; a++)
        (*write[a])[j] = (*read[a])[i];
}

int set_rows_merge(const struct set_rows *all, const uint32_t *row, struct fit_control *control,
                   struct set_rows *distinct)
{
    size_t seen = 0;
    for (size_t i = 0; i < all->count; i++) {
        if (i % (CONTROL_SLICE / 8) == 0 && control_ask(control))
            return FIT_E_CANCELED;
        double g = all->root_g[i] * all->root_g[i];
        if (row[i] == seen) {
            set_rows_copy(all, i, distinct, seen);
            distinct->root_g[seen++] = g;
        } else {
            distinct->root_g[row[i]] += g;
        }
    }
    for (size_t i = 0; i < seen; i++)
        distinct->root_g[i] = sqrt(distinct->root_g[i]);
    return 0;
}

static bool weigh_range(void *ctx, int part, size_t from, size_t to, struct fit_control *control)
{
    struct set_rows *rows = ctx;
    (void)part;
    for (size_t i = from; i < to; i++) {
        if (i % CONTROL_SLICE == 0 && control_ask(control))
            return false;
        rows->spec[i] *= rows->root_g[i];
        rows->diffuse[i] *= rows->root_g[i];
        for (int c = 0; c < SET_CHANNELS && rows->channel[c]; c++)
            rows->channel[c][i] *= rows->root_g[i];
    }
    return true;
}

int set_rows_weigh(struct set_rows *rows, struct fit_control *control)
{
    bool done = pool_ranges(control, rows->count, CONTROL_SLICE / 4, weigh_range, rows);
    return done ? 0 : FIT_E_CANCELED;
}
