// SPDX-License-Identifier: MIT
// What the instrument thread needs to run or to go on with a campaign, read from its file by the
// store thread and given away with the message.
#pragma once
#include "campaign/config.h"
#include "campaign/plan.h"
#include "daemon/engine.h"

#include <stdbool.h>

struct run_material {
    struct campaign_config config;
    struct plan plan; // with what is done
    struct engine_opening opening;
    bool has_opening; // the campaign goes on: opening holds the means of its first dark and beam
                      // readings
};

void run_material_free(void *material); // NULL is fine
