// SPDX-License-Identifier: MIT
// Modbus slaves behind a port: RTU frames (Modbus over Serial Line 1.02) or MBAP frames (Modbus
// Messaging on TCP/IP 1.0b), functions 03, 06, 10h and 17h of the Application Protocol 1.1b3, and
// for units with other tables 01, 02, 04, 05 and 0Fh. Written for the simulator, from those
// documents. Thread: one.
//
// RTU: a frame ends with gap_ns of silence (3.5 characters); a wrong CRC, an unknown unit or a size
// that is no request is answered with silence. With gap_ns 0 (no baud timing) a frame ends as soon
// as its length is complete, and half a frame is forgotten after 20 ms. Unit 0 is a broadcast:
// carried out, not answered. TCP: a frame with a wrong protocol number is ignored; one that cannot
// be framed drops what came.
#pragma once
#include "sim/port.h"

enum {
    MODBUS_BAD_FUNCTION = 1,
    MODBUS_BAD_ADDRESS = 2,
    MODBUS_BAD_VALUE = 3,
    MODBUS_FAILURE = 4,
    MODBUS_BUSY = 6,
    SIM_MODBUS_UNITS = 8
};

enum sim_modbus_table { MODBUS_INPUTS, MODBUS_COILS, MODBUS_DISCRETES };

// The other tables of a unit; each coil and discrete input is a number, 0 or 1.
struct sim_modbus_tables {
    int (*read)(void *ctx, enum sim_modbus_table table, int address, int count, uint16_t *ret,
                int64_t t_ns);
    int (*write_coils)(void *ctx, int address, int count, const uint16_t *values, int64_t t_ns);
};

// The holding registers of one unit. All calls return 0 or an exception code, and then did nothing.
struct sim_modbus_unit {
    int id; // 1..247
    int (*read)(void *ctx, int address, int count, uint16_t *ret_registers, int64_t t_ns);
    int (*write)(void *ctx, int address, int count, const uint16_t *registers, int64_t t_ns);
    void *ctx;
    const struct sim_modbus_tables *tables; // NULL: it has no others
};

struct sim_modbus {
    struct port port; // first
    bool tcp;
    int64_t gap_ns;
    int64_t reply_ns; // the units' time to answer
    struct sim_modbus_unit unit[SIM_MODBUS_UNITS];
    int units;
    uint8_t in[600];
    size_t have;
};

void sim_modbus_init(struct sim_modbus *m, bool tcp, int64_t gap_ns, int64_t reply_ns);
void sim_modbus_add(struct sim_modbus *m, struct sim_modbus_unit unit);

uint16_t sim_modbus_crc(const uint8_t *bytes, size_t size); // sent low byte first
