// SPDX-License-Identifier: MIT
#include "sim/modbus.h"

#include <assert.h>
#include <string.h>

#define FORGET_NS 20000000 // half a frame without baud timing

enum { READ = 0x03, WRITE_ONE = 0x06, WRITE_MANY = 0x10, READ_WRITE = 0x17, PDU_MOST = 253 };

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
    case READ: return 5;
    case WRITE_ONE: return 5;
    case WRITE_MANY: return have < 6 ? 0 : 6 + pdu[5];
    case READ_WRITE: return have < 10 ? 0 : 10 + pdu[9];
    default: return -1;
    }
}

struct answer {
    uint8_t pdu[PDU_MOST];
    int size;
};

static int read_registers(const struct sim_modbus_unit *u, const uint8_t *where, int most,
                          int64_t t_ns, struct answer *a)
{
    int address = word(where), count = word(where + 2);
    if (count < 1 || count > most)
        return MODBUS_BAD_VALUE;
    if (address + count > 0x10000)
        return MODBUS_BAD_ADDRESS;
    uint16_t registers[125];
    int exception = u->read(u->ctx, address, count, registers, t_ns);
    if (exception)
        return exception;
    a->pdu[1] = (uint8_t)(2 * count);
    for (int i = 0; i < count; i++)
        put_word(a->pdu + 2 + 2 * i, registers[i]);
    a->size = 2 + 2 * count;
    return 0;
}

static int write_registers(const struct sim_modbus_unit *u, const uint8_t *where, int most,
                           int64_t t_ns)
{
    int address = word(where), count = word(where + 2), bytes = where[4];
    if (count < 1 || count > most || bytes != 2 * count)
        return MODBUS_BAD_VALUE;
    if (address + count > 0x10000)
        return MODBUS_BAD_ADDRESS;
    uint16_t registers[125];
    for (int i = 0; i < count; i++)
        registers[i] = (uint16_t)word(where + 5 + 2 * i);
    return u->write(u->ctx, address, count, registers, t_ns);
}

static int carry_out(const struct sim_modbus_unit *u, const uint8_t *pdu, int size, int64_t t_ns,
                     struct answer *a)
{
    if (request_size(pdu, (size_t)size) != size)
        return request_size(pdu, (size_t)size) < 0 ? MODBUS_BAD_FUNCTION : MODBUS_BAD_VALUE;
    int exception;
    switch (pdu[0]) {
    case READ: return read_registers(u, pdu + 1, 125, t_ns, a);
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
        return exception ? exception : read_registers(u, pdu + 1, 125, t_ns, a);
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
        for (int i = 0; i < m->units && pdu[0] != READ; i++)
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
