// SPDX-License-Identifier: MIT
// Reads the tables of tests/golden, and measured BRDFs beside the checkout (../shared/real, when
// there): '#' lines, a header row, numbers; what is not a number becomes NAN. Included by one test
// program each; run from the repository's root.
#pragma once
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define GOLDEN_COLUMNS 32

struct golden {
    char *header; // the names point into it
    char *name[GOLDEN_COLUMNS];
    int columns, rows;
    double *value; // rows * columns
};

static inline int golden_split(char *line, char **ret_field)
{
    int count = 0;
    line[strcspn(line, "\r\n")] = 0;
    for (char *comma = line; comma && count < GOLDEN_COLUMNS; line = comma + 1) {
        ret_field[count++] = line;
        comma = strchr(line, ',');
        if (!comma)
            break;
        *comma = 0;
    }
    return count;
}

// false when there is no such file.
static inline bool golden_open(struct golden *t, const char *path)
{
    *t = (struct golden){.columns = 0};
    FILE *in = fopen(path, "r");
    if (!in)
        return false;
    char line[2048], *field[GOLDEN_COLUMNS];
    while (fgets(line, sizeof line, in)) {
        if (line[0] == '#' || line[0] == '\n')
            continue;
        if (!t->columns) {
            t->header = strdup(line);
            t->columns = golden_split(t->header, t->name);
            continue;
        }
        int fields = golden_split(line, field);
        size_t row = (size_t)t->rows++ * (size_t)t->columns;
        t->value = realloc(t->value, (row + (size_t)t->columns) * sizeof *t->value);
        for (int i = 0; i < t->columns; i++) {
            char *end = field[0];
            double v = i < fields ? strtod(field[i], &end) : 0;
            t->value[row + (size_t)i] =
                i < fields && end != field[i] && *end == 0 ? v : (double)NAN;
        }
    }
    fclose(in);
    return true;
}

// A table of tests/golden that has to be there; ends the program otherwise.
static inline struct golden golden_need(const char *name)
{
    struct golden t;
    char path[128];
    snprintf(path, sizeof path, "tests/golden/%s", name);
    if (!golden_open(&t, path) || t.rows == 0) {
        fprintf(stderr, "%s is missing or empty: run the tests from the root of the repository\n",
                path);
        abort();
    }
    return t;
}

static inline void golden_close(struct golden *t)
{
    free(t->value);
    free(t->header);
}

static inline double golden_at(const struct golden *t, int row, const char *column)
{
    for (int i = 0; i < t->columns; i++)
        if (strcmp(t->name[i], column) == 0)
            return t->value[row * t->columns + i];
    fprintf(stderr, "golden table has no column '%s'\n", column);
    abort();
}

// cmocka's assert_float_equal compares floats.
#define assert_near(got, want, tolerance)                                                          \
    do {                                                                                           \
        double near_got = (got), near_want = (want);                                               \
        if (!(fabs(near_got - near_want) <= (tolerance)))                                          \
            fail_msg("%s: %.17g, expected %.17g within %g", #got, near_got, near_want,             \
                     (double)(tolerance));                                                         \
    } while (0)

static inline double golden_rad(double deg)
{
    return deg * (3.14159265358979323846 / 180);
}
