// SPDX-License-Identifier: MIT
#include "sim/modbus.h"

#include <assert.h>
#include <string.h>

#define FORGET_NS 20000000 // half a frame without baud timing

enum {
    READ_COILS = 0x01,
    READ_DISCRETES = 0x02,
    READ = 0x03,
    READ_INPUTS = 0x04,
    WRITE_COIL = 0x05,
    WRITE_ONE = 0x06,
    WRITE_COILS = 0x0f,
    WRITE_MANY = 0x10,
    READ_WRITE = 0x17,
    PDU_MOST = 253,
    REGISTERS_MOST = 125,
    BITS_MOST = 2000
};

uint16_t sim_modbus_crc(const uint8_t *bytes, size_t size)
{
    uint16_t crc = 0xffff;
    for (size_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc & 1 ? crc >> 1 ^ 0xa001 : crc >> 1);
    }
    return crc;
}

static int word(const uint8_t *p)
{
    return p[0] << 8 | p[1];
}

static void put_word(uint8_t *p, int value)
{
    p[0] = (uint8_t)(value >> 8);
    p[1] = (uint8_t)value;
}

// --- requests and answers (PDU: function code and what follows) ----------------------------------

// The length that the request's first bytes promise; 0: not enough of them yet, -1: no request we
// know.
static int request_size(const uint8_t *pdu, size_t have)
{
    if (have < 1)
        return 0;
    switch (pdu[0]) {
    case READ_COILS:
    case READ_DISCRETES:
    case READ:
    case READ_INPUTS:
    case WRITE_COIL:
    case WRITE_ONE: return 5;
    case WRITE_COILS:
    case WRITE_MANY: return have < 6 ? 0 : 6 + pdu[5];
    case READ_WRITE: return have < 10 ? 0 : 10 + pdu[9];
    default: return -1;
    }
}

struct answer {
    uint8_t pdu[PDU_MOST];
    int size;
};

// Address and count, where the count may be that.
static int span(const uint8_t *where, int most, int *ret_address, int *ret_count)
{
    *ret_address = word(where);
    *ret_count = word(where + 2);
    if (*ret_count < 1 || *ret_count > most)
        return MODBUS_BAD_VALUE;
    return *ret_address + *ret_count > 0x10000 ? MODBUS_BAD_ADDRESS : 0;
}

static int read_registers(const struct sim_modbus_unit *u, const uint8_t *where, bool inputs,
                          int64_t t_ns, struct answer *a)
{
    int address, count, exception = span(where, REGISTERS_MOST, &address, &count);
    if (exception)
        return exception;
    uint16_t registers[REGISTERS_MOST];
    exception = inputs ? u->tables->read(u->ctx, MODBUS_INPUTS, address, count, registers, t_ns)
                       : u->read(u->ctx, address, count, registers, t_ns);
    if (exception)
        return exception;
    a->pdu[1] = (uint8_t)(2 * count);
    for (int i = 0; i < count; i++)
        put_word(a->pdu + 2 + 2 * i, registers[i]);
    a->size = 2 + 2 * count;
    return 0;
}

static int read_bits(const struct sim_modbus_unit *u, const uint8_t *where,
                     enum sim_modbus_table table, int64_t t_ns, struct answer *a)
{
    int address, count, exception = span(where, BITS_MOST, &address, &count);
    if (exception)
        return exception;
    uint16_t bits[BITS_MOST];
    exception = u->tables->read(u->ctx, table, address, count, bits, t_ns);
    if (exception)
        return exception;
    int bytes = (count + 7) / 8;
    a->pdu[1] = (uint8_t)bytes;
    memset(a->pdu + 2, 0, (size_t)bytes);
    for (int i = 0; i < count; i++)
        a->pdu[2 + i / 8] |= (uint8_t)((bits[i] != 0) << i % 8);
    a->size = 2 + bytes;
    return 0;
}

static int write_coil(const struct sim_modbus_unit *u, const uint8_t *where, int64_t t_ns)
{
    uint16_t bit = word(where + 2) != 0;
    if (bit && word(where + 2) != 0xff00)
        return MODBUS_BAD_VALUE;
    return u->tables->write_coils(u->ctx, word(where), 1, &bit, t_ns);
}

static int write_coils(const struct sim_modbus_unit *u, const uint8_t *where, int64_t t_ns)
{
    int address, count, exception = span(where, 0x7b0, &address, &count);
    if (exception)
        return exception;
    if (where[4] != (count + 7) / 8)
        return MODBUS_BAD_VALUE;
    uint16_t bits[BITS_MOST];
    for (int i = 0; i < count; i++)
        bits[i] = where[5 + i / 8] >> i % 8 & 1;
    return u->tables->write_coils(u->ctx, address, count, bits, t_ns);
}

static int write_registers(const struct sim_modbus_unit *u, const uint8_t *where, int most,
                           int64_t t_ns)
{
    int address, count, exception = span(where, most, &address, &count);
    if (exception)
        return exception;
    if (where[4] != 2 * count)
        return MODBUS_BAD_VALUE;
    uint16_t registers[REGISTERS_MOST];
    for (int i = 0; i < count; i++)
        registers[i] = (uint16_t)word(where + 5 + 2 * i);
    return u->write(u->ctx, address, count, registers, t_ns);
}

static bool of_tables(uint8_t function)
{
    return function == READ_COILS || function == READ_DISCRETES || function == READ_INPUTS ||
           function == WRITE_COIL || function == WRITE_COILS;
}

static int carry_out(const struct sim_modbus_unit *u, const uint8_t *pdu, int size, int64_t t_ns,
                     struct answer *a)
{
    if (request_size(pdu, (size_t)size) != size)
        return request_size(pdu, (size_t)size) < 0 ? MODBUS_BAD_FUNCTION : MODBUS_BAD_VALUE;
    if (of_tables(pdu[0]) && !u->tables)
        return MODBUS_BAD_FUNCTION;
    int exception;
    switch (pdu[0]) {
    case READ_COILS: return read_bits(u, pdu + 1, MODBUS_COILS, t_ns, a);
    case READ_DISCRETES: return read_bits(u, pdu + 1, MODBUS_DISCRETES, t_ns, a);
    case READ:
    case READ_INPUTS: return read_registers(u, pdu + 1, pdu[0] == READ_INPUTS, t_ns, a);
    case WRITE_COIL:
    case WRITE_COILS:
        memcpy(a->pdu, pdu, 5);
        a->size = 5;
        return pdu[0] == WRITE_COIL ? write_coil(u, pdu + 1, t_ns) : write_coils(u, pdu + 1, t_ns);
    case WRITE_ONE: {
        uint16_t value = (uint16_t)word(pdu + 3);
        memcpy(a->pdu, pdu, 5);
        a->size = 5;
        return u->write(u->ctx, word(pdu + 1), 1, &value, t_ns);
    }
    case WRITE_MANY:
        memcpy(a->pdu, pdu, 5);
        a->size = 5;
        return write_registers(u, pdu + 1, 123, t_ns);
    default: // READ_WRITE: the write comes first
        exception = write_registers(u, pdu + 5, 121, t_ns);
        return exception ? exception : read_registers(u, pdu + 1, false, t_ns, a);
    }
}

static const struct sim_modbus_unit *find(const struct sim_modbus *m, int id)
{
    for (int i = 0; i < m->units; i++)
        if (m->unit[i].id == id)
            return &m->unit[i];
    return NULL;
}

// Fills the answer; false: say nothing.
static bool answer(struct sim_modbus *m, int id, const uint8_t *pdu, int size, int64_t t_ns,
                   struct answer *a)
{
    m->port.frames_in++;
    if (id == 0) {
        for (int i = 0; i < m->units && pdu[0] > READ_INPUTS; i++)
            carry_out(&m->unit[i], pdu, size, t_ns, a);
        return false;
    }
    const struct sim_modbus_unit *u = find(m, id);
    if (!u)
        return false;
    a->pdu[0] = pdu[0];
    int exception = carry_out(u, pdu, size, t_ns, a);
    if (exception) {
        a->pdu[0] = pdu[0] | 0x80;
        a->pdu[1] = (uint8_t)exception;
        a->size = 2;
    }
    return true;
}

// --- RTU -----------------------------------------------------------------------------------------

static void rtu_frame(struct sim_modbus *m, size_t size, int64_t t_ns)
{
    struct answer a = {.size = 0};
    uint16_t crc = sim_modbus_crc(m->in, size - 2);
    if (m->in[size - 2] != (crc & 0xff) || m->in[size - 1] != crc >> 8)
        return;
    if (!answer(m, m->in[0], m->in + 1, (int)size - 3, t_ns, &a))
        return;
    uint8_t frame[PDU_MOST + 3];
    frame[0] = m->in[0];
    memcpy(frame + 1, a.pdu, (size_t)a.size);
    crc = sim_modbus_crc(frame, (size_t)a.size + 1);
    frame[a.size + 1] = crc & 0xff;
    frame[a.size + 2] = (uint8_t)(crc >> 8);
    port_send(&m->port, frame, (size_t)a.size + 3, t_ns + m->reply_ns);
}

static void rtu_silence(struct sim_modbus *m, int64_t t_ns)
{
    if (m->have >= 4 && m->have <= 256)
        rtu_frame(m, m->have, t_ns);
    m->have = 0;
}

// Without baud timing nothing marks a frame's end but its length.
static void rtu_by_length(struct sim_modbus *m, int64_t t_ns)
{
    while (m->have >= 4) {
        int pdu = request_size(m->in + 1, m->have - 1);
        if (pdu < 0) { // a function that is not here: all that came is the frame
            rtu_silence(m, t_ns);
            return;
        }
        size_t size = (size_t)pdu + 3;
        if (pdu == 0 || m->have < size)
            return;
        rtu_frame(m, size, t_ns);
        m->have -= size;
        memmove(m->in, m->in + size, m->have);
    }
}

// --- TCP -----------------------------------------------------------------------------------------

static void tcp_frames(struct sim_modbus *m, int64_t t_ns)
{
    while (m->have >= 8) {
        int size = word(m->in + 4) + 6;
        if (word(m->in + 2) != 0 || size < 8 || size > 260) {
            m->have = 0; // out of step: no frame can be found any more
            return;
        }
        if (m->have < (size_t)size)
            return;
        struct answer a = {.size = 0};
        if (answer(m, m->in[6], m->in + 7, size - 7, t_ns, &a)) {
            uint8_t frame[PDU_MOST + 7];
            memcpy(frame, m->in, 7);
            put_word(frame + 4, a.size + 1);
            memcpy(frame + 7, a.pdu, (size_t)a.size);
            port_send(&m->port, frame, (size_t)a.size + 7, t_ns + m->reply_ns);
        }
        m->have -= (size_t)size;
        memmove(m->in, m->in + size, m->have);
    }
}

// --- the port ------------------------------------------------------------------------------------

static void feed(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    struct sim_modbus *m = (struct sim_modbus *)p;
    while (size > 0) {
        size_t room = sizeof m->in - m->have;
        size_t n = size < room ? size : room;
        memcpy(m->in + m->have, bytes, n);
        m->have += n;
        bytes += n;
        size -= n;
        if (m->tcp)
            tcp_frames(m, t_ns);
        else if (m->gap_ns == 0)
            rtu_by_length(m, t_ns);
        if (m->have == sizeof m->in)
            m->have = m->tcp ? 0 : 257; // too long for a frame; silence will drop it
    }
    if (!m->tcp)
        p->tick_ns = m->have > 0 ? t_ns + (m->gap_ns ? m->gap_ns : FORGET_NS) : PORT_NEVER;
}

static void tick(struct port *p, int64_t t_ns)
{
    struct sim_modbus *m = (struct sim_modbus *)p;
    if (m->gap_ns > 0)
        rtu_silence(m, t_ns);
    m->have = 0;
}

static void hangup(struct port *p)
{
    ((struct sim_modbus *)p)->have = 0;
}

static const struct port_ops ops = {feed, tick, hangup};

void sim_modbus_init(struct sim_modbus *m, bool tcp, int64_t gap_ns, int64_t reply_ns)
{
    memset(m, 0, sizeof *m);
    port_init(&m->port, &ops);
    m->tcp = tcp;
    m->gap_ns = gap_ns;
    m->reply_ns = reply_ns;
}

void sim_modbus_add(struct sim_modbus *m, struct sim_modbus_unit unit)
{
    assert(m->units < SIM_MODBUS_UNITS && unit.id >= 1 && unit.id <= 247 && !find(m, unit.id));
    m->unit[m->units++] = unit;
}
