// SPDX-License-Identifier: MIT
#include "campaign/reading_pick.h"

#include <ctype.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_NUMBER = 100000000 };

static bool take_number(const char **at, int *ret_number)
{
    char *end;
    if (!isdigit((unsigned char)**at))
        return false;
    const long number = strtol(*at, &end, 10);
    *at = end;
    *ret_number = (int)number;
    return number <= MOST_NUMBER;
}

static bool take_one(const char **at, struct reading_pick *p)
{
    *p = (struct reading_pick){.last = READING_PICK_ALL};
    if (!take_number(at, &p->sweep))
        return false;
    if (**at != '/')
        return true;
    ++*at;
    if (!take_number(at, &p->first))
        return false;
    p->last = p->first;
    if (**at == '-') {
        ++*at;
        return take_number(at, &p->last) && p->last >= p->first;
    }
    if (**at != '/')
        return true;
    ++*at;
    return take_number(at, &p->attempt) && p->attempt >= 1;
}

int reading_picks_take(const char *text, struct reading_pick ret_picks[READING_PICKS],
                       struct gon_error *err)
{
    int count = 0;
    for (const char *at = text;; at++) {
        const char *begin = at;
        if (count == READING_PICKS)
            return gon_fail(err, GON_E_INPUT, "more than %d readings or ranges; say it in parts",
                            READING_PICKS);
        const bool good = take_one(&at, &ret_picks[count]);
        if (!good || (*at && *at != ','))
            return gon_fail(err, GON_E_INPUT,
                            "'%.*s' names no reading; use SWEEP/POINT, SWEEP/FIRST-LAST, "
                            "SWEEP/POINT/ATTEMPT or SWEEP, with commas between them",
                            (int)(strcspn(begin, ",") > 40 ? 40 : strcspn(begin, ",")), begin);
        count++;
        if (!*at)
            return count;
    }
}
