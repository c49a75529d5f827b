// SPDX-License-Identifier: MIT
// An Oriental Motor AZ driver as its Modbus registers, moving one axis of the world. 32-bit values
// take two registers, upper word first, and are written both in one transaction (except the input
// command 007D and 0079, whose lower words stand alone). Thread: one.
//
// Source: public drivers, not the manuals HM-60252J and HM-60262E that they cite
// (asukiaaa/arduino-OrientalAZ:src/OrientalAZ_asukiaaa.hpp, oml_mrtu.cpp, VJ_OrientalMaster.h).
// From general knowledge and unverified: the command position 00C6/7, operation type 3, triggers
// -7..-1, and bits 0-4 of the output status 007F (M0_R.., START_R, HOME-END).
//
// Modelled: direct data operation 0058..0069 (types 1, 2, 3; trigger 1 and -7..-1), input command
// 007C/D and its self-clearing twin 0078/9 (STOP, ZHOME, FREE, ALM-RST on their edges; STOP and
// FREE also hold), output status 007E/F, alarm 0080/1, positions, speeds, alarm reset 0180/1,
// P-PRESET 018A/B, configuration 018C/D. Not modelled: stored operation data (START, M0-2),
// jogging, buffer memory: such bits are kept and do nothing; such values are exception 3. As the
// real thing: a move is echoed and ignored while there is an alarm, no current, homing or STOP;
// bits act on 0->1; an alarm is latched; P-PRESET and configuration are exception 4 while moving
// and make the driver busy for 200 ms, in which writes are exception 6; where home is is lost with
// the power.
#pragma once
#include "sim/world.h"

#include <stdbool.h>
#include <stdint.h>

enum { AZ_FIELDS = 9 };

enum sim_az_alarm { // of the AZ alarm list (unverified)
    SIM_AZ_DEVIATION = 0x10,
    SIM_AZ_OVERLOAD = 0x30,
    SIM_AZ_OVERTRAVEL = 0x66
};

struct sim_az {
    struct world *world;
    enum world_axis axis;
    double steps_per_unit;
    double home_speed, home_acceleration; // units/s, units/s2
    int64_t start_ns;                     // from the command to the motor
    // registers
    int32_t field[AZ_FIELDS]; // 0058..0069 in their order
    uint16_t input;           // 007D
    // state
    double origin;         // position of count 0
    int32_t command_steps; // where the last accepted command leads
    int alarm;             // 0: none
    bool homed, homing, current_off;
    int64_t busy_until_ns;                            // SYS-BSY: storing
    uint16_t last_reset, last_preset, last_configure; // for their edges
    uint64_t moves, ignored; // commands carried out, and echoed but ignored
};

struct sim_az_spec {
    double steps_per_unit, home_speed, home_acceleration, start_s;
    bool homed;
};

void sim_az_init(struct sim_az *z, struct world *world, enum world_axis axis,
                 const struct sim_az_spec *spec);
// As struct sim_modbus_unit wants them; ctx is the struct sim_az.
int sim_az_read(void *ctx, int address, int count, uint16_t *ret_registers, int64_t t_ns);
int sim_az_write(void *ctx, int address, int count, const uint16_t *registers, int64_t t_ns);

void sim_az_raise(struct sim_az *z, int alarm, int64_t t_ns); // stops the motor at once
void sim_az_power_cycle(struct sim_az *z, int64_t t_ns); // the count starts at 0 where it stands
int32_t sim_az_position_steps(const struct sim_az *z, int64_t t_ns);
