// SPDX-License-Identifier: MIT
// A Leadshine RS-485 stepper drive in its PR mode (DM556RS, CS2RS, iEM-RS, iCL-RS) as its Modbus
// registers, moving one axis of the world. A parameter is 32 bits over two registers, the upper
// word at the even address; any register may be read and written alone. Thread: one.
//
// Sources: manual pages of CS2RS (p. 15, 19, 43, 50, 52, 59) and public drivers
// (23531056250 dm_556_rs_constants.h, yizhongzhang1989/robot_dc motor_controller.py). From general
// knowledge and unverified: bits 0, 1 and 6 of the motion status, what 6002 reads while it runs,
// that the software enable is off after power-up, and the exceptions of storing.
//
// Modelled: pulses a turn 0001, software enable 000F, motion status 1003, control word 1801
// (alarm reset, store), alarm 2203, PR control 6002 (path 0, home, set zero, quick stop), command
// and motor position 602A..602D, path 0 6200..6207, of which 6207 is 6002 too. As the real thing: a
// move is echoed and ignored while disabled, in alarm or at zero speed; 6002 reads the state, not
// what was written; an alarm is latched; storing is exception 4 while moving and makes the drive
// busy for half a second, in which writes are exception 6; where home is and the enable are lost
// with the power; the position jumps when it is set to zero. Other registers are exception 2.
#pragma once
#include "sim/world.h"

#include <stdbool.h>
#include <stdint.h>

enum { LEADSHINE_FIELDS = 7 }; // 6200..6206

struct sim_leadshine {
    struct world *world;
    enum world_axis axis;
    double steps_per_unit;
    double home_speed, home_acceleration; // units/s, units/s2
    int64_t start_ns;                     // from the command to the motor
    // registers
    uint16_t pulses_per_turn, enabled;
    uint16_t path[LEADSHINE_FIELDS];
    // state
    double origin;         // position of count 0
    int32_t command_steps; // where the last accepted command leads
    int alarm;             // 0: none
    bool homed, homing;
    int64_t busy_until_ns;   // storing
    uint64_t moves, ignored; // commands carried out, and echoed but ignored
};

struct sim_leadshine_spec {
    double steps_per_unit, home_speed, home_acceleration, start_s;
    bool homed;
};

void sim_leadshine_init(struct sim_leadshine *z, struct world *world, enum world_axis axis,
                        const struct sim_leadshine_spec *spec);
// As struct sim_modbus_unit wants them; ctx is the struct sim_leadshine.
int sim_leadshine_read(void *ctx, int address, int count, uint16_t *ret_registers, int64_t t_ns);
int sim_leadshine_write(void *ctx, int address, int count, const uint16_t *registers, int64_t t_ns);

void sim_leadshine_raise(struct sim_leadshine *z, int alarm, int64_t t_ns); // stops at once
void sim_leadshine_power_cycle(struct sim_leadshine *z, int64_t t_ns);
int32_t sim_leadshine_position_steps(const struct sim_leadshine *z, int64_t t_ns);
