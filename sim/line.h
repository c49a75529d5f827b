// SPDX-License-Identifier: MIT
// Commands in lines of text, as simulated serial instruments read them. A line too long loses its
// end and says so once. Thread: one.
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SIM_LINE_MOST = 256 };

struct sim_line {
    char text[SIM_LINE_MOST];
    size_t size;
    bool overflow;
};

// Adds one byte; true when it ended the line (a byte of ends), which then is a string in text until
// the next byte. The caller reads overflow before that, too.
bool sim_line_add(struct sim_line *l, uint8_t byte, const char *ends);
void sim_line_clear(struct sim_line *l);
