// SPDX-License-Identifier: MIT
#include "cli/explain.h"

#include "drivers/laser.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define SAY(to, ...) snprintf(to, sizeof(to), __VA_ARGS__)

const char *finding_level_name(enum finding_level level)
{
    static const char *const names[] = {"well", "look", "WRONG"};
    return names[level];
}

static void begin(struct finding *f, enum finding_level level)
{
    f->level = level;
    f->what[0] = f->why[0] = f->todo[0] = 0;
}

void explain_well(struct finding *f, const char *fmt, ...)
{
    va_list ap;
    begin(f, FINDING_WELL);
    va_start(ap, fmt);
    vsnprintf(f->what, sizeof f->what, fmt, ap);
    va_end(ap);
}

void explain_look(struct finding *f, const char *fmt, ...)
{
    va_list ap;
    begin(f, FINDING_LOOK);
    va_start(ap, fmt);
    vsnprintf(f->what, sizeof f->what, fmt, ap);
    va_end(ap);
}

// --- links ---------------------------------------------------------------------------------------

// Only serial links have a baud rate, only TCP has a port.
static bool is_serial(const struct link *l)
{
    return l->baud > 0;
}

static bool is_tcp(const struct link *l)
{
    return *l->port != 0;
}

void explain_settings(const struct link *l, char *ret_text, size_t size)
{
    *ret_text = 0;
    if (is_serial(l))
        snprintf(ret_text, size, "%d baud, parity %c, %d stop bit%s", l->baud, l->parity, l->stop,
                 l->stop == 1 ? "" : "s");
}

// Our sentences are "what; what to do".
static void split(struct finding *f, const char *text)
{
    const char *next = strstr(text, "; ");
    SAY(f->what, "%.*s", (int)(next ? next - text : (ptrdiff_t)strlen(text)), text);
    if (next)
        SAY(f->todo, "%s", next + 2);
}

static void explain_denied(struct finding *f, const struct link *l)
{
    SAY(f->why, "this user may not read and write the port");
    if (!*f->todo)
        SAY(f->todo,
            "as root: chgrp dialout %s; chmod g+rw %s (a udev rule makes it last), and join the "
            "group: sudo usermod -aG dialout USER, then log in again",
            l->place, l->place);
}

static void explain_serial(struct finding *f, const struct gon_error *err, const struct link *l,
                           const char *ports)
{
    if (strstr(err->text, "permission denied")) {
        explain_denied(f, l);
    } else if (err->code == GON_E_REFUSED) {
        SAY(f->why, "a port belongs to one program at a time");
    } else if (strstr(err->text, "no such port")) {
        SAY(f->why, "the adapter is not plugged in, has no power, or has another name");
        SAY(f->todo, "plug it in, or mend the link in the bench file; %s", ports);
    } else if (err->code == GON_E_INPUT && l->adapter) {
        SAY(f->why, "which of them is meant cannot be told");
    } else {
        SAY(f->why, "the port is there and refuses");
        if (!*f->todo)
            SAY(f->todo, "unplug its adapter and plug it in again; dmesg tells more");
    }
}

static void explain_tcp(struct finding *f, const struct gon_error *err, const struct link *l)
{
    if (strstr(err->text, "no address for this host")) {
        SAY(f->why, "the name is not known to this machine's name service");
        SAY(f->todo, "check the spelling of '%s', or write the address in its place: HOST:PORT",
            l->place);
    } else if (strstr(err->text, strerror(ECONNREFUSED))) {
        SAY(f->why, "the host is there, but nothing listens on that port");
        SAY(f->todo, "is the serial server or gateway started, and is its port %s?", l->port);
    } else {
        SAY(f->why, "nothing answers at that address");
        SAY(f->todo,
            "is it switched on, its network cable in, and this machine in the same network? "
            "try: ping %s",
            l->place);
    }
}

void explain_open(struct finding *f, const struct gon_error *err, const struct link *l,
                  const char *ports)
{
    begin(f, FINDING_WRONG);
    split(f, err->text);
    if (is_serial(l))
        explain_serial(f, err, l, ports);
    else if (is_tcp(l))
        explain_tcp(f, err, l);
}

// Nothing came.
static void explain_silence(struct finding *f, const struct link *l)
{
    char settings[64];
    explain_settings(l, settings, sizeof settings);
    if (is_serial(l)) {
        SAY(f->why, "nobody answers: no power, the cable, or another baud rate or parity");
        SAY(f->todo,
            "is it switched on? is the cable in, and the right one (straight or crossed)? does the "
            "device's own menu say %s?",
            settings);
    } else if (is_tcp(l)) {
        SAY(f->why, "the connection is there, but nobody answers behind it");
        SAY(f->todo,
            "is the device switched on, its cable in the serial server, and the server's baud rate "
            "and parity the device's?");
    } else {
        SAY(f->why, "nobody answers");
        SAY(f->todo, "switch it off and on, and plug it in again");
    }
}

void explain_talk(struct finding *f, const struct gon_error *err, const struct link *l,
                  const char *expected)
{
    begin(f, FINDING_WRONG);
    if (strstr(err->text, "turn its echo off")) {
        split(f, err->text);
        SAY(f->why, "it repeats each command, so that no answer can be told from it");
        return;
    }
    SAY(f->what, "%s", err->text);
    if (err->code == GON_E_GONE) {
        SAY(f->why, "%s",
            is_tcp(l) ? "connections are closed at once: a serial server often has one at a time, "
                        "which another program may hold"
                      : "it was unplugged just now");
        SAY(f->todo, "%s", is_tcp(l) ? "end the other program" : "check the plug and try again");
    } else if (err->code == GON_E_DEVICE) {
        SAY(f->why, "something else than a %s answers on this port", expected);
        SAY(f->todo, "look which device is plugged in there, or mend driver or link in the bench "
                     "file");
    } else if (strstr(err->text, "no answer") || strstr(err->text, "does not answer")) {
        explain_silence(f, l);
    } else {
        SAY(f->why, "bytes come, but not the words of a %s", expected);
        SAY(f->todo, "another baud rate or parity, or another kind of device; compare with the "
                     "device's own menu");
    }
}

void explain_instead(struct finding *f, const char *identity, const char *is, const char *expected,
                     const char *link)
{
    begin(f, FINDING_WRONG);
    SAY(f->what, "%s: this is the %s (%s), the config expects the %s", link, is, identity,
        expected);
    SAY(f->why, "cables or links are exchanged");
    SAY(f->todo, "exchange the plugs, or the links of %s and %s in the bench file", is, expected);
}

void explain_unit(struct finding *f, int unit, const char *others)
{
    begin(f, FINDING_WRONG);
    SAY(f->what, "unit %d does not answer, while unit%s %s on the same bus do%s", unit,
        strchr(others, ',') ? "s" : "", others, strchr(others, ',') ? "" : "es");
    SAY(f->why, "its address switch stands on another number, it has no power, or the bus ends "
                "before it");
    SAY(f->todo,
        "set its address switch to %d (and switch it off and on), or mend unit in the "
        "bench file; check its power and the bus cable to it",
        unit);
}

void explain_bus(struct finding *f, const struct link *l, const char *link, const char *units)
{
    char settings[64];
    explain_settings(l, settings, sizeof settings);
    begin(f, FINDING_WRONG);
    SAY(f->what, "%s: nobody answers on this bus (asked: unit %s)", link, units);
    if (is_serial(l)) {
        SAY(f->why, "no power, another baud rate or parity, the wires A and B exchanged, or the "
                    "cable");
        SAY(f->todo,
            "are the controllers switched on? do their switches say %s? exchange A and B; is the "
            "line terminated at both ends?",
            settings);
    } else {
        SAY(f->why, "the gateway is reached, but nobody answers behind it");
        SAY(f->todo, "are the controllers switched on, wired to the gateway, and its baud rate and "
                     "parity theirs?");
    }
}

// --- devices -------------------------------------------------------------------------------------

void explain_emission(struct finding *f)
{
    begin(f, FINDING_WRONG);
    SAY(f->what, "LASER MAY BE ON: told to switch off, it still says that it emits or starts");
    SAY(f->why, "it ignores OFF, or something else switches it on");
    SAY(f->todo, "use its key or the interlock now; then find out what else commands it");
}

void explain_relit(struct finding *f)
{
    begin(f, FINDING_WRONG);
    SAY(f->what, "it was found emitting after OFF; switched off again, and reads back off");
    SAY(f->why, "something else switches it on: its panel, its autostart, another computer");
    SAY(f->todo, "find out what else commands it before you go near the beam");
}

void explain_alarm(struct finding *f, int code, const char *text)
{
    begin(f, FINDING_WRONG);
    SAY(f->what, "alarm %02Xh%s%s", (unsigned)code, *text ? ": " : "", text);
    SAY(f->why, "its controller has stopped and refuses to move");
    SAY(f->todo, "remove the cause, then reset the alarm: the controller's button, or off and on");
}

void explain_home(struct finding *f)
{
    begin(f, FINDING_LOOK);
    SAY(f->what, "its controller does not know its home");
    SAY(f->why, "it was switched on, restarted or lost its power since it was homed");
    SAY(f->todo, "nothing: a run homes it first; keep its way clear");
}

void explain_no_reference(struct finding *f)
{
    begin(f, FINDING_WRONG);
    SAY(f->what, "it has no reference: its lock is lost");
    SAY(f->why, "the chopper stands still, or its cable is not in Ref In");
    SAY(f->todo, "start the chopper, and look at the lock-in's UNLOCK light");
}

bool explain_laser(struct finding *f, const struct laser_status *s, const char *fault_text)
{
    begin(f, FINDING_WRONG);
    if (!s->interlock_closed || s->state == LASER_INTERLOCK) {
        SAY(f->what, "its interlock is open");
        SAY(f->why, "a door, a cover or the interlock plug; no run can begin");
        SAY(f->todo, "close it; the laser may then want its key turned off and on");
    } else if (s->state == LASER_NEEDS_KEY) {
        SAY(f->what, "it wants its key");
        SAY(f->why, "its interlock was opened, or it was switched off, since the key was turned");
        SAY(f->todo, "turn its key switch off and on");
    } else if (s->state == LASER_FAULT) {
        SAY(f->what, "fault %d: %s", s->fault_code, fault_text);
        SAY(f->why, "the laser protects itself");
        SAY(f->todo, "let it cool down, remove the cause, then switch it off and on");
    } else {
        return false;
    }
    return true;
}
