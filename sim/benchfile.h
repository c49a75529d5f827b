// SPDX-License-Identifier: MIT
// The bench file that lets goniod use the simulated bench. Thread: any.
#pragma once
#include "sim/config.h"

#include <stdio.h>

struct benchfile_links { // as goniod.cfg names links
    const char *axes, *laser, *detector;
};

void benchfile_write(FILE *out, const struct sim_config *c, const struct benchfile_links *links);
