// SPDX-License-Identifier: MIT
#include "sim/line.h"

#include <string.h>

void sim_line_clear(struct sim_line *l)
{
    l->size = 0;
    l->overflow = false;
    l->text[0] = 0;
}

bool sim_line_add(struct sim_line *l, uint8_t byte, const char *ends)
{
    if (l->size == SIM_LINE_MOST) { // the mark of a line that has ended
        sim_line_clear(l);
    }
    if (byte != 0 && strchr(ends, byte)) {
        l->text[l->size] = 0;
        l->size = SIM_LINE_MOST;
        return true;
    }
    if (l->size < SIM_LINE_MOST - 1)
        l->text[l->size++] = (char)byte;
    else
        l->overflow = true;
    return false;
}
