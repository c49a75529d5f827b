// SPDX-License-Identifier: MIT
// What examine.c (laser, detector, axes) and examine_devices.c (monitor, selectors, inputs) share;
// nobody else includes it.
#pragma once
#include "cli/examine.h"
#include "drivers/link.h"

void examine_tell(const struct examine *e, struct finding *f, const char *fmt, ...)
    __attribute__((format(printf, 3, 4))); // fmt: who
// It could not be opened; it does not talk.
void examine_tell_open(const struct examine *e, const char *who, const char *text,
                       enum link_use use, const struct gon_error *err);
void examine_tell_talk(const struct examine *e, const char *part, const char *port,
                       const char *driver, const struct gon_error *err);
void examine_devices(const struct examine *e);
