// SPDX-License-Identifier: MIT
// The profiles that goniosim is told of: a file, or the name of one that is known. Thread: any.
#pragma once
#include "base/cfg.h"
#include "sim/config.h"

// "x.cfg" is in this folder, too. ret_path (PATH_MAX; may be NULL) gets the absolute path. Free the
// profile. Mistakes in it go to the sink.
int profiles_load(const char *name, struct cfg_sink sink, struct profile **ret_profile,
                  char *ret_path, struct gon_error *err);
// Those that the configuration names: loaded, of the right role, such that they can be simulated.
// They live until profiles_free.
int profiles_of_bench(struct sim_config *c, struct cfg_sink sink, struct gon_error *err);
void profiles_free(struct sim_config *c);
