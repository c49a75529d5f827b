// SPDX-License-Identifier: MIT
#include "model/state.h"

#include <string.h>

static const struct {
    const char *name;
    struct brdf_stokes stokes;
} states[BRDF_STATES] = {
    [BRDF_STATE_U] = {"u", {{1, 0, 0, 0}}},          [BRDF_STATE_S] = {"s", {{1, 1, 0, 0}}},
    [BRDF_STATE_P] = {"p", {{1, -1, 0, 0}}},         [BRDF_STATE_PLUS45] = {"+45", {{1, 0, 1, 0}}},
    [BRDF_STATE_MINUS45] = {"-45", {{1, 0, -1, 0}}}, [BRDF_STATE_R] = {"R", {{1, 0, 0, 1}}},
    [BRDF_STATE_L] = {"L", {{1, 0, 0, -1}}},
};

struct brdf_stokes brdf_state_stokes(enum brdf_state state)
{
    return states[state].stokes;
}

struct brdf_stokes brdf_state_analyser(enum brdf_state state)
{
    struct brdf_stokes a = states[state].stokes;
    if (state != BRDF_STATE_U)
        for (int i = 0; i < 4; i++)
            a.s[i] /= 2;
    return a;
}

const char *brdf_state_name(enum brdf_state state)
{
    return states[state].name;
}

int brdf_state_find(const char *name)
{
    for (int i = 0; i < BRDF_STATES; i++)
        if (strcmp(states[i].name, name) == 0)
            return i;
    return -1;
}
