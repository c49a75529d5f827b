// SPDX-License-Identifier: MIT
#include "drivers/transport_modbus.h"

#include "drivers/modbus_relay.h"

#include <errno.h>
#include <modbus/modbus.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>

#define BYTE_GAP_MS 50

enum { READ_COILS = 1, READ_REGISTERS = 3, WRITE_COIL = 5, WRITE_REGISTER = 6, WRITE_COILS = 15 };
enum { UNIT_AND_CRC = 3, MBAP = 7, EXCEPTION = 2 }; // bytes around a PDU, and of one

struct modbus_master {
    modbus_t *library;
    struct transport *t;
    bool rtu;
    struct modbus_relay *relay; // while a request is under way that somebody listens to
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
    modbus_master_set_timeout(m, timeout_ms);
    modbus_set_error_recovery(m->library, MODBUS_ERROR_RECOVERY_NONE);
    return m;
}

void modbus_master_set_timeout(struct modbus_master *m, int timeout_ms)
{
    const int byte_ms = timeout_ms < BYTE_GAP_MS ? timeout_ms : BYTE_GAP_MS;
    modbus_set_response_timeout(m->library, (uint32_t)timeout_ms / 1000,
                                (uint32_t)(timeout_ms % 1000) * 1000);
    modbus_set_byte_timeout(m->library, 0, (uint32_t)byte_ms * 1000);
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
    case EHOSTUNREACH: transport_hung_up(m->t, error, NULL); return MASTER_GONE;
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

// --- listening in --------------------------------------------------------------------------------

// libmodbus moves its bytes itself: where they have to be seen it is given the relay's end instead
// of the line, for this one request. Without threads or memory it is not seen.
static void listen_in(struct modbus_master *m)
{
    if (transport_tapped(m->t) && (m->relay = modbus_relay_start(transport_fd(m->t))))
        modbus_set_socket(m->library, modbus_relay_fd(m->relay));
}

static void show_frames(struct modbus_master *m)
{
    struct modbus_relay_bytes sent, received;
    const int error = errno;
    if (!m->relay)
        return;
    modbus_set_socket(m->library, transport_fd(m->t));
    modbus_relay_end(m->relay, &sent, &received);
    m->relay = NULL;
    transport_show(m->t, TAP_SENT, sent.byte, sent.size);
    transport_show(m->t, TAP_RECEIVED, received.byte, received.size);
    errno = error; // libmodbus', for outcome()
}

// --- reading -------------------------------------------------------------------------------------

static int read_bits(struct modbus_master *m, int function, int address, int count,
                     uint16_t *ret_registers)
{
    uint8_t bits[MODBUS_MAX_READ_BITS];
    int rc = function == READ_COILS ? modbus_read_bits(m->library, address, count, bits)
                                    : modbus_read_input_bits(m->library, address, count, bits);
    for (int i = 0; rc >= 0 && i < count; i++)
        ret_registers[i] = bits[i];
    return rc;
}

static int read_registers(struct modbus_master *m, int function, int address, int count,
                          uint16_t *ret_registers)
{
    uint16_t registers[MODBUS_MAX_READ_REGISTERS];
    int rc = function == READ_REGISTERS
                 ? modbus_read_registers(m->library, address, count, registers)
                 : modbus_read_input_registers(m->library, address, count, registers);
    for (int i = 0; rc >= 0 && i < count; i++)
        ret_registers[i] = registers[i];
    return rc;
}

enum master_outcome modbus_master_read(struct modbus_master *m, int unit, int function, int address,
                                       int count, uint16_t *ret_registers)
{
    modbus_set_slave(m->library, unit);
    listen_in(m);
    errno = 0;
    const bool bits = function < READ_REGISTERS;
    const int rc = bits ? read_bits(m, function, address, count, ret_registers)
                        : read_registers(m, function, address, count, ret_registers);
    show_frames(m);
    const enum master_outcome o = outcome(m, rc);
    count_bytes(m, o, 5, 2 + (bits ? (count + 7) / 8 : 2 * count));
    return o;
}

// --- writing -------------------------------------------------------------------------------------

static void put_word(uint8_t *at, int word)
{
    at[0] = (uint8_t)(word >> 8);
    at[1] = (uint8_t)word;
}

// Unit and PDU. Returns its size.
static int write_request(int unit, int function, int address, int count, const uint16_t *registers,
                         uint8_t *ret_request)
{
    uint8_t *r = ret_request;
    r[0] = (uint8_t)unit;
    r[1] = (uint8_t)function;
    put_word(r + 2, address);
    put_word(r + 4, function == WRITE_COIL       ? (registers[0] ? 0xff00 : 0)
                    : function == WRITE_REGISTER ? registers[0]
                                                 : count);
    if (function == WRITE_COIL || function == WRITE_REGISTER)
        return 6;
    r[6] = (uint8_t)(function == WRITE_COILS ? (count + 7) / 8 : 2 * count);
    memset(r + 7, 0, r[6]);
    for (int i = 0; i < count; i++)
        if (function == WRITE_COILS)
            r[7 + i / 8] |= (uint8_t)((registers[i] != 0) << i % 8);
        else
            put_word(r + 7 + 2 * i, registers[i]);
    return 7 + r[6];
}

// The answer repeats function, address and value or count. libmodbus 3.1.6 compares less of it.
static enum master_outcome check_echo(const struct modbus_master *m, const uint8_t *request,
                                      const uint8_t *answer, int size)
{
    const int header = modbus_get_header_length(m->library); // RTU: the unit
    const bool rtu = header == 1;
    const int crc = rtu ? 2 : 0;
    const uint8_t *pdu = answer + header;
    if (size == header + 2 + crc && pdu[0] == (request[1] | 0x80) && pdu[1] >= 1 &&
        pdu[1] <= MASTER_EXCEPTION_LAST)
        return (enum master_outcome)pdu[1];
    const bool same = size == header + 5 + crc && (!rtu || answer[0] == request[0]) &&
                      memcmp(pdu, request + 1, 5) == 0;
    return same ? MASTER_DONE : MASTER_MISFIT;
}

enum master_outcome modbus_master_write(struct modbus_master *m, int unit, int function,
                                        int address, int count, const uint16_t *registers)
{
    uint8_t request[MODBUS_MAX_ADU_LENGTH], answer[MODBUS_MAX_ADU_LENGTH];
    modbus_set_slave(m->library, unit);
    listen_in(m);
    errno = 0;
    int size = write_request(unit, function, address, count, registers, request);
    int rc = modbus_send_raw_request(m->library, request, size);
    if (rc >= 0)
        rc = modbus_receive_confirmation(m->library, answer);
    show_frames(m);
    const enum master_outcome o = rc < 0 ? outcome(m, rc) : check_echo(m, request, answer, rc);
    count_bytes(m, o, size - 1, 5);
    return o;
}
