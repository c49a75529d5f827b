// SPDX-License-Identifier: MIT
// GET /api/v1/devices: every part of the bench with its identity, its state and what its link has
// seen. doc/goniod.8.scd lists the members. The caller owns what is returned; NULL without memory.
// Thread: main.
#pragma once
#include "daemon/instrument.h"

#include <jansson.h>

json_t *inventory_view(const struct instrument_snapshot *s); // an array; s NULL: an empty one
json_t *inventory_traffic(const struct link_stats *stats);   // counters and latencies of a link
