// SPDX-License-Identifier: MIT
// One Modbus bus, RTU or TCP, shared by its units, over libmodbus.
//
//   modbus-rtu:/dev/serial/by-id/...?baud=115200&parity=E&stop=1     modbus-tcp:host:port
//
// libmodbus can return the previous register's value after a late or doubled reply on RTU. So:
// flush before each request; after any error that is not an exception answer, drain until the line
// was quiet for quiet_ms; keep the silent gap (3.5 characters, at least 1.75 ms: Modbus over Serial
// Line 1.02, 2.5.1.1); and callers give neighbouring reads different lengths, so that a stale reply
// fails its length check. TCP is closed and reconnected after any such error. Link recovery inside
// libmodbus stays off (it never returns once a device is gone). A write that timed out may have
// been carried out: nothing here repeats one.
//
// An answer takes at most timeout_ms, during which nothing else happens; all other waits give the
// clock its turn. Writes (STOP is one) go out whatever was cancelled. A pty has no parity: there it
// is not set. Descriptors of 1024 and more are refused (libmodbus uses select): open buses early.
// Thread: the one that opened it.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"

#include <stdbool.h>
#include <stdint.h>

struct bus;
struct link_stats;
struct tap;

// timeout_ms: of one answer, 10..200 (the laser's lease allows no longer silence); quiet_ms: the
// slowest answer a unit was ever seen to give, 20..5000.
int bus_open(const char *link, int timeout_ms, int quiet_ms, struct clk *clk,
             const struct cancel *cancel, struct bus **ret_bus, struct gon_error *err);
void bus_close(struct bus *b);
// What one of its units needs: both are raised to that, never lowered, and stay within the limits
// above. 0: whatever they are.
void bus_expect(struct bus *b, int timeout_ms, int quiet_ms);
int bus_reopen(struct bus *b, struct gon_error *err); // one try

enum bus_table { BUS_HOLDING, BUS_INPUT, BUS_COIL, BUS_DISCRETE };

// Functions 3, 4, 1 and 2. Reads are repeated, tries (1..3) in all, after resynchronising.
// GON_E_LINK, GON_E_GONE; GON_E_DEVICE for an exception answer (text says which; busy is waited
// out, up to 1 s). unit 1..247, count 1..125; a coil or input is a register of 0 or 1.
int bus_read_table(struct bus *b, int unit, enum bus_table table, int address, int count, int tries,
                   uint16_t *ret_registers, struct gon_error *err);
// Functions 16 and 15; single (count 1): 6 and 5. Sent once; an answer "busy" means that it was not
// carried out, so then it is sent again. BUS_HOLDING or BUS_COIL, count 1..123.
int bus_write_table(struct bus *b, int unit, enum bus_table table, int address, int count,
                    bool single, const uint16_t *registers, struct gon_error *err);
// Holding registers, functions 3 (3 tries) and 16.
int bus_read(struct bus *b, int unit, int address, int count, uint16_t *ret_registers,
             struct gon_error *err);
int bus_write(struct bus *b, int unit, int address, int count, const uint16_t *registers,
              struct gon_error *err);
int bus_exception(const struct bus *b);  // code of the last answer; 0: it was none
int64_t bus_now_ns(const struct bus *b); // of its clock
const char *bus_link(const struct bus *b);
const struct link_stats *bus_stats(const struct bus *b);
// Who is told of every frame (drivers/tap.h); borrowed. Each request then takes a thread and some
// 0.1 ms more. NULL: nobody.
void bus_tap(struct bus *b, const struct tap *tap);
