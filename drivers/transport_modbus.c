// SPDX-License-Identifier: MIT
#include "drivers/transport_modbus.h"

#include <errno.h>
#include <modbus/modbus.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/select.h>

#define BYTE_GAP_MS 50

enum { UNIT_AND_CRC = 3, MBAP = 7, EXCEPTION = 2 }; // bytes around a PDU, and of one

struct modbus_master {
    modbus_t *library;
    struct transport *t;
    bool rtu;
};

struct modbus_master *modbus_master_new(struct transport *t, bool rtu, int timeout_ms)
{
    struct modbus_master *m = calloc(1, sizeof *m);
    if (!m)
        return NULL;
    // Names and settings are never used: the descriptor is given.
    m->library =
        rtu ? modbus_new_rtu("/dev/null", 115200, 'N', 8, 1) : modbus_new_tcp("127.0.0.1", 502);
    if (!m->library) {
        free(m);
        return NULL;
    }
    m->t = t;
    m->rtu = rtu;
    const int byte_ms = timeout_ms < BYTE_GAP_MS ? timeout_ms : BYTE_GAP_MS;
    modbus_set_response_timeout(m->library, (uint32_t)timeout_ms / 1000,
                                (uint32_t)(timeout_ms % 1000) * 1000);
    modbus_set_byte_timeout(m->library, 0, (uint32_t)byte_ms * 1000);
    modbus_set_error_recovery(m->library, MODBUS_ERROR_RECOVERY_NONE);
    return m;
}

void modbus_master_free(struct modbus_master *m)
{
    if (!m)
        return;
    modbus_set_socket(m->library, -1); // the descriptor is the transport's
    modbus_free(m->library);
    free(m);
}

int modbus_master_attach(struct modbus_master *m, struct gon_error *err)
{
    const int fd = transport_fd(m->t);
    if (fd < 0)
        return gon_fail(err, GON_E_GONE, "%s: not open since it hung up", transport_link(m->t));
    if (fd >= FD_SETSIZE)
        return gon_fail(
            err, GON_E_SYSTEM,
            "%s: descriptor %d is too large for libmodbus (most %d); open fewer files before",
            transport_link(m->t), fd, FD_SETSIZE - 1);
    modbus_set_socket(m->library, fd);
    return 0;
}

// A hang-up may show as end of file, EIO or silence: poll says which.
static bool hung_up(const struct modbus_master *m)
{
    struct pollfd p = {transport_fd(m->t), POLLIN, 0};
    return poll(&p, 1, 0) > 0 && (p.revents & (POLLHUP | POLLERR | POLLNVAL));
}

static enum master_outcome outcome(struct modbus_master *m, int rc)
{
    const int error = errno;
    if (rc >= 0)
        return MASTER_DONE;
    if (error > MODBUS_ENOBASE && error <= MODBUS_ENOBASE + MASTER_EXCEPTION_LAST)
        return (enum master_outcome)(error - MODBUS_ENOBASE);
    switch (error) {
    case EIO:
    case EBADF:
    case ENXIO:
    case ENODEV:
    case EPIPE:
    case ENOTCONN:
    case ECONNRESET:
    case EHOSTUNREACH:
        transport_hung_up(m->t, error, NULL);
        return MASTER_GONE;
    default: break;
    }
    if (hung_up(m)) {
        transport_hung_up(m->t, 0, NULL);
        return MASTER_GONE;
    }
    if (error == ETIMEDOUT || error == EAGAIN)
        return MASTER_SILENT;
    return error == EMBBADCRC ? MASTER_GARBLED : MASTER_MISFIT;
}

// libmodbus does not say what it moved. What it could not use is not counted as received.
static void count_bytes(struct modbus_master *m, enum master_outcome o, int request, int answer)
{
    struct link_stats *book = transport_book(m->t);
    const int around = m->rtu ? UNIT_AND_CRC : MBAP;
    book->bytes_out += (uint64_t)(around + request);
    if (o < MASTER_SILENT)
        book->bytes_in += (uint64_t)(around + (o == MASTER_DONE ? answer : EXCEPTION));
}

enum master_outcome modbus_master_read(struct modbus_master *m, int unit, int address, int count,
                                       uint16_t *ret_registers)
{
    uint16_t registers[MODBUS_MAX_READ_REGISTERS];
    modbus_set_slave(m->library, unit);
    errno = 0;
    enum master_outcome o =
        outcome(m, modbus_read_registers(m->library, address, count, registers));
    count_bytes(m, o, 5, 2 + 2 * count);
    for (int i = 0; o == MASTER_DONE && i < count; i++)
        ret_registers[i] = registers[i];
    return o;
}

enum master_outcome modbus_master_write(struct modbus_master *m, int unit, int address, int count,
                                        const uint16_t *registers)
{
    modbus_set_slave(m->library, unit);
    errno = 0;
    enum master_outcome o =
        outcome(m, modbus_write_registers(m->library, address, count, registers));
    count_bytes(m, o, 6 + 2 * count, 5);
    return o;
}
