// SPDX-License-Identifier: MIT
#include "drivers/profile_golden.h"

#include "drivers/bus.h"
#include "drivers/golden_peer.h"
#include "drivers/profile_token.h"
#include "drivers/session.h"

#include <ctype.h>
#include <fnmatch.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NEAR 1e-6 // relative: sources print some digits
#define EXCEPTION 0x80
#define COUNT_MOST ((int)(sizeof((struct golden_params *)0)->name / PROFILE_NAME))

enum { TIMEOUT_MS = 200, QUIET_MS = 20 };

// --- bytes ---------------------------------------------------------------------------------------

static void add(struct golden_bytes *b, const char *text)
{
    const size_t size = strlen(text);
    if (b->size + size <= sizeof b->byte) {
        memcpy(b->byte + b->size, text, size);
        b->size += size;
    }
}

// What is asked for errors says their texts and does not refuse.
bool profile_golden_refuses(const struct profile *p, const char *does, const char *answer)
{
    const bool asks_errors = *p->errors.ask && strcmp(does, p->errors.ask) == 0;
    for (int i = 0; i < p->refusals_count && !asks_errors; i++)
        if (fnmatch(p->refusals[i].like, answer, FNM_CASEFOLD) == 0)
            return p->refusals[i].means != PROFILE_FINE;
    return false;
}

// What the instrument sends: echo, answer, the line that says OK, as its framing has them. No such
// line follows a refusal.
static void add_answer(const struct profile *p, const struct profile_golden *g,
                       struct golden_bytes *b)
{
    const struct profile_framing *f = &p->framing;
    if (*f->echo_end) {
        add(b, g->sent);
        add(b, f->echo_end);
    }
    add(b, g->received);
    if (*f->echo_end || *g->received)
        add(b, f->end_in);
    if (*f->ok_line && !profile_golden_refuses(p, g->does, g->received)) {
        add(b, f->ok_line);
        add(b, f->end_in);
    }
}

static int digit_of(char c)
{
    return c <= '9' ? c - '0' : (c & 7) + 9;
}

// "07 10 62 00": pairs of digits, blanks where one likes.
static int read_frame(const char *text, const char *name, struct golden_bytes *ret_bytes,
                      struct gon_error *err)
{
    struct golden_bytes b = {.size = 0};
    for (; *text; text++) {
        if (*text == ' ')
            continue;
        if (!isxdigit((unsigned char)text[0]) || !isxdigit((unsigned char)text[1]) ||
            b.size == sizeof b.byte)
            return gon_fail(err, GON_E_INPUT, "%s: '%.8s' is not bytes in hexadecimal", name, text);
        b.byte[b.size++] = (uint8_t)(16 * digit_of(text[0]) + digit_of(text[1]));
        text++;
    }
    *ret_bytes = b;
    return 0;
}

// --- values --------------------------------------------------------------------------------------

int profile_golden_with(const struct profile *p, const char *text, struct profile_data *d,
                        struct golden_params *ret_params, struct gon_error *err)
{
    const char *at = text;
    int count = 0;
    struct profile_token comma = {.kind = PROFILE_TOKEN_END};
    do {
        const struct profile_token name = profile_token_next(&at);
        if (name.kind == PROFILE_TOKEN_END)
            break;
        const struct profile_token sign = profile_token_next(&at), right = profile_token_next(&at);
        const int value = profile_value(p, name.text);
        double number;
        if (!profile_token_is(&sign, "=") || strlen(name.text) >= PROFILE_NAME ||
            count == COUNT_MOST ||
            profile_literal(value < 0 ? NULL : &p->values[value], right.text, &number, NULL) < 0)
            return gon_fail(err, GON_E_INPUT, "with: '%.80s' is not NAME = NUMBER, ...", text);
        if (value >= 0)
            profile_data_set(p, d, value, number);
        strcpy(ret_params->name[count], name.text);
        ret_params->param[count] = (struct profile_param){ret_params->name[count], number};
        count++;
        comma = profile_token_next(&at);
    } while (profile_token_is(&comma, ","));
    ret_params->param[count].name = NULL;
    return 0;
}

static bool is_same(const struct profile_data *a, const struct profile_data *b, int value)
{
    if (!b->known[value] || isnan(a->number[value]) != isnan(b->number[value]))
        return false;
    if (isnan(a->number[value]))
        return strcmp(a->text[value], b->text[value]) == 0;
    return a->number[value] == b->number[value] ||
           fabs(a->number[value] - b->number[value]) <= NEAR * fabs(a->number[value]);
}

static void show(const struct profile_data *d, int value, char ret_text[40])
{
    if (!d->known[value])
        snprintf(ret_text, 40, "nothing");
    else if (isnan(d->number[value]))
        snprintf(ret_text, 40, "'%.36s'", d->text[value]);
    else
        snprintf(ret_text, 40, "%.10g", d->number[value]);
}

static int compare(const struct profile *p, const char *gives, const struct profile_data *got,
                   struct gon_error *err)
{
    struct profile_data shown;
    profile_data_clear(&shown);
    int rc = profile_assign_data(p, gives, NULL, &shown, err);
    for (int i = 0; i < p->values_count && rc == 0; i++)
        if (shown.known[i] && !is_same(&shown, got, i)) {
            char a[40], b[40];
            show(got, i, a);
            show(&shown, i, b);
            rc = gon_fail(err, GON_E_INPUT, "%s: got %s / expected %s", p->values[i].name, a, b);
        }
    return rc;
}

// Where no answer is shown none comes, and that it is missed says nothing.
static int forgive(const struct profile_golden *g, int rc)
{
    return (rc == GON_E_LINK || rc == GON_E_GONE) && !*g->received ? 0 : rc;
}

// --- messages ------------------------------------------------------------------------------------

// Only this one exchange: nothing that gets into step, waits or reads back.
static struct profile *only(const struct profile *p, const struct profile_golden *g)
{
    struct profile *copy = malloc(sizeof *copy);
    if (!copy)
        return NULL;
    *copy = *p;
    *copy->framing.sync = 0;
    copy->framing.gap_ms = 0;
    copy->framing.quiet_ms = QUIET_MS;
    copy->framing.timeout_ms = TIMEOUT_MS;
    copy->registers.quiet_ms = QUIET_MS;
    copy->registers.timeout_ms = TIMEOUT_MS;
    const int exchange = profile_exchange(p, g->does), write = profile_write(p, g->does);
    if (p->protocol == PROFILE_MESSAGE && exchange >= 0) {
        struct profile_exchange *x = &copy->exchanges[exchange];
        *x->verify = 0;
        x->settle_ms = x->timeout_ms = 0;
        x->check = false;
    } else if (p->protocol == PROFILE_MODBUS && write >= 0) {
        *copy->writes[write].verify = 0;
        copy->writes[write].readback = copy->writes[write].repeat = false;
    }
    return copy;
}

static int talk(const struct profile *p, const struct profile_golden *g, const char *path,
                struct gon_error *err)
{
    struct session *s;
    char link[100];
    snprintf(link, sizeof link, "serial:%s", path);
    int rc = session_open(p, link, clk_system(), NULL, &s, err);
    if (rc < 0)
        return rc;
    rc = profile_assign_data(p, g->with, NULL, session_data(s), err);
    if (rc == 0)
        rc = session_send(s, g->does, NULL, err);
    const bool refused = session_meaning(s) != PROFILE_FINE && !*g->gives;
    if (rc == 0)
        rc = compare(p, g->gives, session_data(s), err);
    session_free(s);
    return refused ? 0 : forgive(g, rc);
}

// --- Modbus --------------------------------------------------------------------------------------

static int ask_bus(const struct profile *p, const struct profile_golden *g, struct session *s,
                   struct gon_error *err)
{
    struct profile_asks asks = {.count = g->asks_count};
    memcpy(asks.name, g->asks, sizeof asks.name);
    int rc = session_ask_once(s, &asks, err);
    return rc < 0 ? rc : compare(p, g->gives, session_data(s), err);
}

static int talk_bus(const struct profile *p, const struct profile_golden *g, const char *path,
                    struct gon_error *err)
{
    struct bus *bus;
    struct golden_params params = {0};
    char link[100];
    snprintf(link, sizeof link, "modbus-rtu:%s", path);
    int rc = bus_open(link, TIMEOUT_MS, QUIET_MS, clk_system(), NULL, &bus, err);
    if (rc < 0)
        return rc;
    struct session *s = session_on_bus(p, bus, g->unit);
    if (!s)
        rc = gon_fail(err, GON_E_SYSTEM, "out of memory");
    else
        rc = profile_golden_with(p, g->with, session_data(s), &params, err);
    if (rc == 0)
        rc = *g->does ? session_send(s, g->does, params.param, err) : ask_bus(p, g, s, err);
    session_free(s);
    bus_close(bus);
    return forgive(g, rc);
}

// --- both ----------------------------------------------------------------------------------------

static int write_script(const struct profile *p, const struct profile_golden *g,
                        struct golden_script *s, struct gon_error *err)
{
    const int write = profile_write(p, g->does);
    if (p->protocol == PROFILE_MESSAGE) {
        add(&s->sent, g->sent);
        add(&s->sent, p->framing.end_out);
        add_answer(p, g, &s->received);
        return 0;
    }
    s->rtu = true;
    // What a bit was before nobody knows: it is taken back first, then set.
    s->shown = write >= 0 && *p->writes[write].edge ? 1 : 0;
    int rc = read_frame(g->sent, "sent", &s->sent, err);
    return rc < 0 ? rc : read_frame(g->received, "received", &s->received, err);
}

// The first of both that is wrong: what was sent, else what became of it.
static int play(const struct profile *p, const struct profile_golden *g, struct gon_error *err)
{
    struct golden_script script = {.rtu = false};
    struct golden_peer *peer;
    struct gon_error why = {0};
    int rc = write_script(p, g, &script, err);
    if (rc == 0)
        rc = golden_peer_start(&script, &peer, err);
    if (rc < 0)
        return rc;
    const bool modbus = p->protocol == PROFILE_MODBUS;
    int talked = modbus ? talk_bus(p, g, golden_peer_path(peer), &why)
                        : talk(p, g, golden_peer_path(peer), &why);
    if (modbus && talked == GON_E_DEVICE && script.received.byte[1] & EXCEPTION)
        talked = 0;
    rc = golden_peer_finish(peer, err);
    if (talked < 0 && (rc == 0 || talked == GON_E_INPUT))
        return gon_fail(err, GON_E_INPUT, "%s", why.text);
    return rc;
}

int profile_golden_check(const struct profile *p, int entry, struct gon_error *err)
{
    const struct profile_golden *g = &p->golden[entry];
    struct profile *copy = only(p, g);
    if (!copy)
        return gon_fail(err, GON_E_SYSTEM, "out of memory");
    int rc = play(copy, g, err);
    free(copy);
    return rc;
}
