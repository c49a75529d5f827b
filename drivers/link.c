// SPDX-License-Identifier: MIT
#include "drivers/link.h"

#include <ctype.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

struct scheme {
    const char *name;
    enum link_use use;
    enum link_kind kind;
    char parity;
    const char *port; // default
};

static const struct scheme schemes[] = {
    {"serial:", LINK_TEXT, LINK_SERIAL, 'N', NULL},
    {"tcp:", LINK_TEXT, LINK_TCP, 0, NULL},
    {"usbtmc:", LINK_TEXT, LINK_USBTMC, 0, NULL},
    {"modbus-rtu:", LINK_MODBUS, LINK_SERIAL, 'E', NULL},
    {"modbus-tcp:", LINK_MODBUS, LINK_TCP, 0, "502"},
};

static const char *const forms[] = {
    [LINK_TEXT] = "serial:/dev/serial/by-id/NAME?baud=115200&parity=N&stop=1, tcp:HOST:PORT or "
                  "usbtmc:VID:PID:SERIAL",
    [LINK_MODBUS] = "modbus-rtu:/dev/serial/by-id/NAME?baud=115200&parity=E&stop=1 or "
                    "modbus-tcp:HOST:PORT",
};

static const char adapter_prefix[] = "usb-"; // in the place of a serial port's path

static const int bauds[] = {1200,  2400,   4800,   9600,   19200, 38400,
                            57600, 115200, 230400, 460800, 921600};

static bool copy(char *to, size_t size, const char *from, size_t length)
{
    if (length == 0 || length >= size)
        return false;
    memcpy(to, from, length);
    to[length] = 0;
    return true;
}

// Decimal digits only, at most six of them; -1: it is not that.
static int whole_number(const char *text, size_t length)
{
    int value = 0;
    if (length < 1 || length > 6)
        return -1;
    for (size_t i = 0; i < length; i++) {
        if (text[i] < '0' || text[i] > '9')
            return -1;
        value = 10 * value + (text[i] - '0');
    }
    return value;
}

static bool set_baud(struct link *l, const char *value, size_t length)
{
    l->baud = whole_number(value, length);
    for (size_t i = 0; i < sizeof bauds / sizeof bauds[0]; i++)
        if (bauds[i] == l->baud)
            return true;
    return false;
}

static bool set_parity(struct link *l, const char *value, size_t length)
{
    if (length != 1 || !strchr("NEO", value[0]))
        return false;
    l->parity = value[0];
    return true;
}

static bool set_stop(struct link *l, const char *value, size_t length)
{
    l->stop = whole_number(value, length);
    return l->stop == 1 || l->stop == 2;
}

static const struct setting {
    const char *name, *allowed;
    bool (*set)(struct link *l, const char *value, size_t length);
} settings[] = {
    {"baud=", "1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600",
     set_baud},
    {"parity=", "N, E, O", set_parity},
    {"stop=", "1, 2", set_stop},
};

static int parse_setting(const char *text, const char *item, size_t length, struct link *l,
                         struct gon_error *err)
{
    for (size_t i = 0; i < sizeof settings / sizeof settings[0]; i++) {
        const struct setting *s = &settings[i];
        size_t name = strlen(s->name);
        if (length < name || strncmp(item, s->name, name) != 0)
            continue;
        if (s->set(l, item + name, length - name))
            return 0;
        return gon_fail(err, GON_E_INPUT, "link '%s': '%.*s' is not possible; allowed: %s", text,
                        (int)length, item, s->allowed);
    }
    return gon_fail(err, GON_E_INPUT,
                    "link '%s': unknown setting '%.*s'; known: baud, parity, stop", text,
                    (int)length, item);
}

// Four hexadecimal digits; -1: they are not that.
static int hex_number(const char *text)
{
    static const char digits[] = "0123456789abcdef";
    int value = 0;
    for (int i = 0; i < 4; i++) {
        const char *digit = text[i] ? strchr(digits, tolower((unsigned char)text[i])) : NULL;
        if (!digit)
            return -1;
        value = 16 * value + (int)(digit - digits);
    }
    return value;
}

// The serial number is all that follows, colons too; it must be printable and without blanks.
static bool is_serial_number(const char *text)
{
    for (const char *c = text; *c; c++)
        if (*c <= ' ' || *c > '~')
            return false;
    return *text && strlen(text) < sizeof((struct link *)0)->place;
}

// "VID:PID" or "VID:PID:SERIAL": the serial number, "" without; NULL: it is not that.
static const char *parse_numbers(const char *rest, struct link *l)
{
    const int vendor = hex_number(rest);
    const int product = vendor >= 0 && rest[4] == ':' ? hex_number(rest + 5) : -1;
    const char *after = product >= 0 ? rest + 9 : "?";
    if (*after && (*after != ':' || !is_serial_number(after + 1)))
        return NULL;
    l->vendor = (uint16_t)vendor;
    l->product = (uint16_t)product;
    return *after ? after + 1 : after;
}

static bool parse_place(struct link *l)
{
    l->adapter = strncmp(l->place, adapter_prefix, strlen(adapter_prefix)) == 0;
    return !l->adapter || parse_numbers(l->place + strlen(adapter_prefix), l);
}

static int parse_serial(const char *text, const char *rest, struct link *l, struct gon_error *err)
{
    size_t length = strcspn(rest, "?");
    if (!copy(l->place, sizeof l->place, rest, length))
        return gon_fail(err, GON_E_INPUT,
                        "link '%s': a path of 1 to %zu bytes must follow the colon", text,
                        sizeof l->place - 1);
    if (!parse_place(l))
        return gon_fail(err, GON_E_INPUT,
                        "link '%s': after usb- comes VID:PID or VID:PID:SERIAL, VID and PID of four "
                        "hexadecimal digits each (lsusb shows them); a path begins with /",
                        text);
    l->baud = 115200;
    l->stop = 1;
    for (rest += length; *rest; rest += length) {
        rest++; // '?' or '&'
        length = strcspn(rest, "&");
        int rc = parse_setting(text, rest, length, l, err);
        if (rc < 0)
            return rc;
    }
    return 0;
}

static int parse_tcp(const char *text, const char *rest, const char *port, struct link *l,
                     struct gon_error *err)
{
    const bool bracket = *rest == '[';
    const char *host = rest + bracket;
    size_t length = strcspn(host, bracket ? "]" : ":");
    const char *after = host + length;
    bool good = copy(l->place, sizeof l->place, host, length);
    if (good && bracket)
        good = *after++ == ']';
    if (good && *after == ':')
        port = after + 1;
    else if (good && *after)
        good = false;
    const int number = port ? whole_number(port, strlen(port)) : -1;
    if (!good || number < 1 || number > 65535)
        return gon_fail(err, GON_E_INPUT, "link '%s': wants HOST:PORT with a port of 1..65535",
                        text);
    copy(l->port, sizeof l->port, port, strlen(port));
    return 0;
}

static int parse_usbtmc(const char *text, const char *rest, struct link *l, struct gon_error *err)
{
    const char *serial = parse_numbers(rest, l);
    if (!serial)
        return gon_fail(err, GON_E_INPUT,
                        "link '%s': wants VID:PID or VID:PID:SERIAL, VID and PID of four "
                        "hexadecimal digits each (lsusb shows them)",
                        text);
    strcpy(l->place, serial);
    return 0;
}

static int parse_rest(const struct scheme *s, const char *text, const char *rest, struct link *l,
                      struct gon_error *err)
{
    switch (s->kind) {
    case LINK_SERIAL: return parse_serial(text, rest, l, err);
    case LINK_TCP: return parse_tcp(text, rest, s->port, l, err);
    case LINK_USBTMC: break;
    }
    return parse_usbtmc(text, rest, l, err);
}

const char *link_serial_number(const struct link *l)
{
    const size_t numbers = strlen(adapter_prefix) + strlen("0123:4567");
    if (l->kind == LINK_USBTMC)
        return l->place;
    return l->adapter && l->place[numbers] ? l->place + numbers + 1 : "";
}

int link_parse(const char *text, enum link_use use, struct link *ret_link, struct gon_error *err)
{
    for (size_t i = 0; i < sizeof schemes / sizeof schemes[0]; i++) {
        const struct scheme *s = &schemes[i];
        size_t length = strlen(s->name);
        if (s->use != use || strncmp(text, s->name, length) != 0)
            continue;
        struct link l = {.kind = s->kind, .parity = s->parity};
        int rc = parse_rest(s, text, text + length, &l, err);
        if (rc == 0)
            *ret_link = l;
        return rc;
    }
    return gon_fail(err, GON_E_INPUT, "link '%s': unknown kind; wants %s", text, forms[use]);
}
