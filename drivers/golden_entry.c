// SPDX-License-Identifier: MIT
#include "drivers/golden_entry.h"

#include "drivers/checksum.h"
#include "drivers/golden_text.h"
#include "drivers/profile_golden.h"
#include "drivers/profile_text.h"
#include "drivers/profile_when.h"
#include "drivers/registers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BLANKS " \t\r\n"

enum { MBAP = 7, MBAP_UNIT = 6, CRC = 2, EXCEPTION = 0x80, REGISTERS = 125 };

// --- both kinds ----------------------------------------------------------------------------------

static int check(const struct golden_maker *m, const struct profile_golden *g,
                 struct gon_error *err)
{
    struct profile *copy = malloc(sizeof *copy);
    if (!copy)
        return gon_fail(err, GON_E_SYSTEM, "out of memory");
    *copy = *m->p;
    copy->golden[0] = *g;
    copy->golden_count = 1;
    int rc = profile_golden_check(copy, 0, err);
    free(copy);
    return rc;
}

// What the values are that stand in a pattern or frame, but for those that mean nothing by
// themselves: whoever plays the entry knows no more than it says.
static void write_values(const struct profile *p, const bool uses[PROFILE_VALUES],
                         const struct profile_data *d, char *text, size_t size)
{
    *text = 0;
    for (int i = 0; i < p->values_count; i++)
        if (uses[i] && d->known[i] && profile_when(p, p->values[i].valid, d))
            golden_text_value(p, d, i, text, size);
}

static struct profile_golden begin(const struct golden_maker *m)
{
    struct profile_golden g = {.unit = m->unit};
    snprintf(g.source, sizeof g.source, "%s", m->source);
    return g;
}

// --- messages ------------------------------------------------------------------------------------

static bool ends_with(const struct golden_bytes *b, const char *text)
{
    const size_t size = strlen(text);
    return b->size >= size && memcmp(b->byte + b->size - size, text, size) == 0;
}

static bool cut_end(struct golden_bytes *b, const char *text)
{
    const bool is = ends_with(b, text);
    if (is)
        b->size -= strlen(text);
    return is;
}

static bool cut_begin(struct golden_bytes *b, const char *text)
{
    const size_t size = strlen(text);
    if (b->size < size || memcmp(b->byte, text, size) != 0)
        return false;
    b->size -= size;
    memmove(b->byte, b->byte + size, b->size);
    return true;
}

static int copy_text(const struct golden_bytes *b, char ret_text[PROFILE_LONG],
                     struct gon_error *err)
{
    if (b->size >= PROFILE_LONG)
        return gon_fail(err, GON_E_INPUT, "too long for an entry");
    for (size_t i = 0; i < b->size; i++) // profiles are UTF-8, and their texts end with zero
        if (b->byte[i] == 0 || b->byte[i] >= 0x80)
            return gon_fail(err, GON_E_INPUT, "byte %02X cannot be written in a profile",
                            b->byte[i]);
    memcpy(ret_text, b->byte, b->size);
    ret_text[b->size] = 0;
    return 0;
}

// As the golden check puts it together, backwards.
static int unwrap(const struct golden_maker *m, const struct captured *c, struct profile_golden *g,
                  struct gon_error *err)
{
    const struct profile_framing *f = &m->p->framing;
    struct golden_bytes sent = c->sent, received = c->received;
    if (!cut_end(&sent, f->end_out))
        return gon_fail(err, GON_E_INPUT, "it did not leave as a whole");
    int rc = copy_text(&sent, g->sent, err);
    if (rc < 0)
        return rc;
    if (*f->echo_end && received.size > 0 &&
        (!cut_begin(&received, g->sent) || !cut_begin(&received, f->echo_end)))
        return gon_fail(err, GON_E_LINK, "the command was not repeated as it was sent");
    if (received.size > 0 && !m->is_usb && !ends_with(&received, f->end_in))
        return gon_fail(err, GON_E_LINK, "broken off: it does not end as the profile says");
    if (*f->ok_line && cut_end(&received, f->end_in))
        cut_end(&received, f->ok_line);
    cut_end(&received, f->end_in);
    return copy_text(&received, g->received, err);
}

static bool is_sent_by(const struct profile *p, const struct profile_exchange *x,
                       const struct profile_data *d, const char *sent)
{
    char command[PROFILE_LONG];
    size_t size;
    if (profile_text_write(p, x->send, d, command, sizeof command, NULL) < 0)
        return false;
    return (p->checksum.kind == PROFILE_NO_SUM ||
            checksum_append(&p->checksum, command, strlen(command), sizeof command, &size, NULL) ==
                0) &&
           strcmp(command, sent) == 0;
}

static const struct profile_exchange *sender(const struct profile *p, const char *does,
                                             const struct profile_data *d, const char *sent)
{
    const int first = profile_exchange(p, does);
    if (first >= 0 && is_sent_by(p, &p->exchanges[first], d, sent))
        return &p->exchanges[first];
    for (int i = 0; i < p->exchanges_count; i++)
        if (is_sent_by(p, &p->exchanges[i], d, sent))
            return &p->exchanges[i];
    return NULL;
}

// The answer as its pattern sees it: without checksum and blanks around.
static int bare(const struct profile *p, const char *received, char ret_text[PROFILE_LONG],
                struct gon_error *err)
{
    const char *from = received + strspn(received, BLANKS);
    size_t size = strlen(from);
    memcpy(ret_text, from, size + 1);
    int rc = p->checksum.kind == PROFILE_NO_SUM || size == 0
                 ? 0
                 : checksum_take(&p->checksum, ret_text, size, &size, err);
    while (size > 0 && strchr(BLANKS, ret_text[size - 1]))
        size--;
    ret_text[size] = 0;
    return rc;
}

static int read_answer(const struct profile *p, const struct profile_exchange *x,
                       struct profile_golden *g, struct gon_error *err)
{
    struct profile_data now;
    char text[PROFILE_LONG];
    bool uses[PROFILE_VALUES] = {false};
    int rc = bare(p, g->received, text, err);
    if (rc < 0 || (*text && profile_golden_refuses(p, x->name, text)))
        return rc;
    if (!*x->answer && *text)
        return gon_fail(err, GON_E_LINK, "an answer where none comes");
    profile_data_clear(&now);
    rc = *x->answer ? profile_text_read(p, x->answer, text, &now, err) : 0;
    profile_text_uses(p, x->answer, uses);
    write_values(p, uses, &now, g->gives, sizeof g->gives);
    return rc;
}

// Where neither answer, echo nor OK come, nothing has to.
static bool must_answer(const struct profile *p, const struct profile_exchange *x)
{
    return *x->answer || *p->framing.echo_end || *p->framing.ok_line;
}

static int make_message(const struct golden_maker *m, const struct captured *c, const char *does,
                        const struct profile_data *d, struct profile_golden *g,
                        struct gon_error *err)
{
    const struct profile *p = m->p;
    bool uses[PROFILE_VALUES] = {false};
    int rc = unwrap(m, c, g, err);
    if (rc < 0)
        return rc;
    const struct profile_exchange *x = sender(p, does, d, g->sent);
    if (!x)
        return gon_fail(err, GON_E_INPUT, "none of the profile's exchanges");
    snprintf(g->does, sizeof g->does, "%s", x->name);
    if (must_answer(p, x) && c->received.size == 0)
        return gon_fail(err, GON_E_LINK, "no answer");
    profile_text_uses(p, x->send, uses);
    write_values(p, uses, d, g->with, sizeof g->with);
    return read_answer(p, x, g, err);
}

// --- Modbus --------------------------------------------------------------------------------------

// Of TCP: the header goes and a CRC comes.
static bool to_rtu(const struct golden_maker *m, struct golden_bytes *b)
{
    if (m->wire == GOLDEN_RTU || b->size == 0)
        return true;
    if (b->size < MBAP + 1 || b->size > sizeof b->byte - CRC)
        return false;
    b->size -= MBAP_UNIT;
    memmove(b->byte, b->byte + MBAP_UNIT, b->size);
    golden_bytes_add_crc(b);
    return true;
}

static int word_at(const struct golden_bytes *b, size_t at)
{
    return b->byte[at] << 8 | b->byte[at + 1];
}

// The registers or bits of an answer, as bus.c gives them; false: it is none to this request.
static bool take_registers(const struct golden_bytes *answer, int function, int count,
                           uint16_t ret_registers[REGISTERS])
{
    const bool bits = function <= 2;
    const size_t bytes = (size_t)(bits ? (count + 7) / 8 : 2 * count);
    if (count > REGISTERS || answer->size != 3 + bytes + CRC || answer->byte[1] != function)
        return false;
    for (int i = 0; i < count; i++)
        ret_registers[i] = (uint16_t)(bits ? answer->byte[3 + i / 8] >> i % 8 & 1
                                           : word_at(answer, 3 + 2 * (size_t)i));
    return true;
}

// The readable values that lie in what is read, and what they are.
static int read_values(const struct profile *p, const struct golden_bytes *sent,
                       const uint16_t *registers, bool ret_uses[PROFILE_VALUES],
                       struct profile_data *now, struct gon_error *err)
{
    static const int tables[] = {0, PROFILE_COIL, PROFILE_DISCRETE, PROFILE_HOLDING, PROFILE_INPUT};
    const int begin = word_at(sent, 2), end = begin + word_at(sent, 4);
    for (int i = 0; i < p->values_count; i++) {
        const struct profile_value *v = &p->values[i];
        int address;
        double number = (double)NAN;
        if (v->table != tables[sent->byte[1]] || v->access == PROFILE_WRITE ||
            registers_address(p, v, &address, NULL) < 0 || address < begin ||
            address + registers_count(v) > end)
            continue;
        ret_uses[i] = true;
        if (!registers)
            continue;
        const double wire = registers_wire(p, v, registers + (address - begin));
        if (!isnan(wire) && profile_number(v, wire, &number, err) < 0)
            return GON_E_LINK;
        profile_data_set(p, now, i, number);
    }
    return 0;
}

static int read_request(const struct profile *p, const struct golden_bytes *sent,
                        const struct golden_bytes *received, struct profile_golden *g,
                        struct gon_error *err)
{
    uint16_t registers[REGISTERS];
    struct profile_data now;
    bool uses[PROFILE_VALUES] = {false};
    const bool refused = received->size > 1 && received->byte[1] & EXCEPTION;
    profile_data_clear(&now);
    if (!refused && !take_registers(received, sent->byte[1], word_at(sent, 4), registers))
        return gon_fail(err, GON_E_LINK, "%s", received->size ? "no answer to this" : "no answer");
    int rc = read_values(p, sent, refused ? NULL : registers, uses, &now, err);
    for (int i = 0; i < p->values_count && rc == 0; i++) {
        if (uses[i] && g->asks_count == PROFILE_ASKS)
            return gon_fail(err, GON_E_INPUT, "more values than one entry asks for");
        if (uses[i])
            snprintf(g->asks[g->asks_count++], PROFILE_NAME, "%s", p->values[i].name);
    }
    write_values(p, uses, &now, g->gives, sizeof g->gives);
    if (rc == 0 && g->asks_count == 0)
        rc = gon_fail(err, GON_E_INPUT, "none of the profile's values");
    return rc;
}

static int make_frames(const struct golden_maker *m, const struct captured *c, const char *does,
                       const char *with, struct profile_golden *g, struct gon_error *err)
{
    struct golden_bytes sent = c->sent, received = c->received;
    if (!to_rtu(m, &sent) || !to_rtu(m, &received) || sent.size < 8)
        return gon_fail(err, GON_E_LINK, "no Modbus frame");
    if (3 * sent.size + 8 > PROFILE_LONG || 3 * received.size + 8 > PROFILE_LONG)
        return gon_fail(err, GON_E_INPUT, "too long for an entry");
    golden_bytes_show(&sent, true, g->sent, sizeof g->sent);
    golden_bytes_show(&received, true, g->received, sizeof g->received);
    if (sent.byte[1] >= 1 && sent.byte[1] <= 4)
        return read_request(m->p, &sent, &received, g, err);
    if (received.size == 0)
        return gon_fail(err, GON_E_LINK, "no answer");
    if (profile_write(m->p, does) < 0)
        return gon_fail(err, GON_E_INPUT, "none of the profile's writes");
    snprintf(g->does, sizeof g->does, "%s", does);
    snprintf(g->with, sizeof g->with, "%s", with);
    return 0;
}

int golden_entry_make(const struct golden_maker *m, const struct captured *c, const char *does,
                      const char *with, const struct profile_data *d,
                      struct profile_golden *ret_golden, struct gon_error *err)
{
    struct profile_golden g = begin(m);
    int rc = m->wire == GOLDEN_MESSAGE ? make_message(m, c, does, d, &g, err)
                                       : make_frames(m, c, does, with, &g, err);
    if (rc == 0)
        rc = check(m, &g, err);
    if (rc == 0)
        *ret_golden = g;
    return rc;
}
