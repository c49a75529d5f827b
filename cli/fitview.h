// SPDX-License-Identifier: MIT
// A fit for people: parameters with uncertainties and intervals, what is identified and what is
// not, and the quantities that the data do determine.
#pragma once

struct json_t; // of jansson

// The object of `gonio fit --json` as a table on stdout and its warnings as sentences on stderr.
void fitview_print(const struct json_t *fit);
// "sigma 0.1502 ± 0.0003, kd ..., Delta 1.2e-4" in one line.
void fitview_line(const struct json_t *fit, char *text, unsigned long size);
