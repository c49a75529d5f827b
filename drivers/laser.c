// SPDX-License-Identifier: MIT
#include "drivers/laser.h"

const char *laser_state_name(enum laser_state s)
{
    switch (s) {
    case LASER_OFF: return "off";
    case LASER_WARMING: return "warming";
    case LASER_EMITTING: return "emitting";
    case LASER_INTERLOCK: return "interlock open";
    case LASER_NEEDS_KEY: return "needs its key";
    case LASER_FAULT: return "fault";
    }
    return "unknown";
}
