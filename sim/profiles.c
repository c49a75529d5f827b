// SPDX-License-Identifier: MIT
#include "sim/profiles.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

int profiles_load(const char *name, struct cfg_sink sink, struct profile **ret_profile,
                  char *ret_path, struct gon_error *err)
{
    char path[PATH_MAX];
    size_t size = strlen(name);
    bool file = !strchr(name, '/') && size > 4 && strcmp(name + size - 4, ".cfg") == 0;
    int rc = 0;
    if (file)
        snprintf(path, sizeof path, "%s", name);
    else
        rc = profile_find(name, NULL, path, sizeof path, err);
    if (rc == 0 && ret_path && !realpath(path, ret_path))
        rc = gon_fail(err, GON_E_INPUT, "%s: %s", path, strerror(errno));
    if (rc == 0 && profile_load(path, sink, ret_profile, NULL))
        rc = gon_fail(err, GON_E_INPUT, "%s is not usable; nothing was started", path);
    return rc;
}

// What can be read here, too: the simulator has its own code for that.
static int try_it(const struct profile *p, struct gon_error *err)
{
    struct actor *a = calloc(1, sizeof *a);
    int rc = a ? actor_init(a, p, 0, err) : gon_fail(err, GON_E_SYSTEM, "out of memory");
    free(a);
    return rc;
}

static int take(const char *part, int role, char name[SIM_CONFIG_PATH], struct cfg_sink sink,
                const struct profile **ret_profile, struct gon_error *err)
{
    struct profile *p = NULL;
    char path[PATH_MAX];
    if (!*name)
        return 0;
    int rc = profiles_load(name, sink, &p, path, err);
    if (rc == 0 && p->role != role)
        rc = gon_fail(err, GON_E_INPUT, "%s.profile = %s: is of the role %s, not %s", part, name,
                      profile_roles[p->role], profile_roles[role]);
    if (rc == 0 && role == PROFILE_AXIS && p->protocol != PROFILE_MODBUS)
        rc = gon_fail(err, GON_E_INPUT, "%s.profile = %s: axes speak Modbus", part, name);
    if (rc == 0 && strlen(path) >= SIM_CONFIG_PATH)
        rc = gon_fail(err, GON_E_INPUT, "%s.profile: the path is too long: %s", part, path);
    rc = rc ? rc : try_it(p, err);
    if (rc) {
        free(p);
        return rc;
    }
    strcpy(name, path);
    *ret_profile = p;
    return 0;
}

int profiles_of_bench(struct sim_config *c, struct cfg_sink sink, struct gon_error *err)
{
    int rc = take("axes", PROFILE_AXIS, c->axes_profile, sink, &c->bench.axes, err);
    if (rc == 0)
        rc = take("laser", PROFILE_LASER, c->laser_profile, sink, &c->bench.laser, err);
    if (rc == 0)
        rc = take("detector", PROFILE_DETECTOR, c->detector_profile, sink, &c->bench.detector, err);
    if (rc == 0 && c->bench.laser && c->bench.laser->protocol != PROFILE_MESSAGE)
        rc = gon_fail(err, GON_E_INPUT, "laser.profile: must answer in lines of text");
    if (rc == 0 && c->bench.detector && c->bench.detector->protocol != PROFILE_MESSAGE)
        rc = gon_fail(err, GON_E_INPUT, "detector.profile: must answer in lines of text");
    return rc;
}

void profiles_free(struct sim_config *c)
{
    free((void *)c->bench.axes);
    free((void *)c->bench.laser);
    free((void *)c->bench.detector);
    c->bench.axes = c->bench.laser = c->bench.detector = NULL;
}
