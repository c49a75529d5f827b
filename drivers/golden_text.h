// SPDX-License-Identifier: MIT
// Golden entries as a profile writes them, and values as "with" and "gives" do. Pure but for the
// file written to. Thread: any.
#pragma once
#include "drivers/profile_data.h"

#include <stdio.h>

// "{ does = ...; source = ...; }" on lines of its own, without a comma behind it. Modbus entries
// also say their unit.
void golden_text_print(FILE *out, const struct profile_golden *g, bool modbus);
// A string in double quotes as libconfig reads it back: the same bytes.
void golden_text_string(FILE *out, const char *text);

// Appends ", name = value" (without the comma at first) so that it is read back the same. False: it
// cannot be said so (a text with a quote in it, or no room); text then stays.
bool golden_text_value(const struct profile *p, const struct profile_data *d, int value, char *text,
                       size_t size);
