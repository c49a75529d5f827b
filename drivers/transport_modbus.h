// SPDX-License-Identifier: MIT
// libmodbus 3.1.6 over a transport's descriptor: one request, one classified outcome. The transport
// opens, locks and closes the descriptor (modbus_connect and modbus_close are never called: they
// would set a pty's parity, which fails, and restore line settings that were never saved). Inside
// this layer. Thread: the transport's.
#pragma once
#include "base/err.h"
#include "drivers/transport.h"

#include <stdbool.h>
#include <stdint.h>

struct modbus_master;

enum master_outcome {
    MASTER_DONE = 0,
    // 1..11: the exception code of the answer
    MASTER_SILENT = 100, // no answer in time
    MASTER_GARBLED,      // its checksum is wrong
    MASTER_MISFIT,       // length, unit, function or transaction do not fit
    MASTER_GONE          // the transport is closed now
};

enum {
    MASTER_EXCEPTION_FUNCTION = 1,
    MASTER_EXCEPTION_ADDRESS = 2,
    MASTER_EXCEPTION_VALUE = 3,
    MASTER_EXCEPTION_FAILURE = 4,
    MASTER_EXCEPTION_ACKNOWLEDGE = 5,
    MASTER_EXCEPTION_BUSY = 6,
    MASTER_EXCEPTION_LAST = 11
};

// The transport is borrowed. timeout_ms: of the first byte; the following may be 50 ms apart.
struct modbus_master *modbus_master_new(struct transport *t, bool rtu, int timeout_ms);
void modbus_master_free(struct modbus_master *m);
void modbus_master_set_timeout(struct modbus_master *m, int timeout_ms);

// The descriptor may have changed since the last call. A descriptor of 1024 or more would abort in
// libmodbus' select(): GON_E_SYSTEM. GON_E_GONE when the transport is closed.
int modbus_master_attach(struct modbus_master *m, struct gon_error *err);

// Functions 1, 2, 3 and 4. count 1..125 registers, 1..2000 bits; a bit is a register of 0 or 1.
enum master_outcome modbus_master_read(struct modbus_master *m, int unit, int function, int address,
                                       int count, uint16_t *ret_registers);
// Functions 5 and 6 (count 1), 15 and 16. count 1..123 registers or bits.
enum master_outcome modbus_master_write(struct modbus_master *m, int unit, int function,
                                        int address, int count, const uint16_t *registers);
