// SPDX-License-Identifier: MIT
// uses: sim drivers model base
// Instruments made from profiles, fed with bytes and times: text with echo, OK line, prompt,
// checksum, refusals and gap; registers with 32-bit values, bits, edges and exceptions; values that
// go somewhere. In virtual time.
#include "sim/actor_message.h"
#include "sim/actor_registers.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MS(ms) ((int64_t)((ms)*1e6))
#define HEAD(protocol, role, more)                                                                 \
    "profile: { name = \"p\"; title = \"t\"; role = \"" role "\"; source = \"this test\"; "        \
    "protocol = \"" protocol "\"; };\n" role ": { " more " };\n"
#define ASKED(exchange) HEAD("message", "inputs", "status = ( \"" exchange "\" );")

static void say(void *ctx, const char *line)
{
    (void)ctx;
    print_message("%s\n", line);
}

static struct profile *parse(const char *text)
{
    struct profile *p = NULL;
    if (profile_parse(text, "test.cfg", (struct cfg_sink){say, NULL}, &p))
        fail_msg("the profile cannot be read");
    return p;
}

static double number(const struct actor *a, const char *name)
{
    int value = actor_values_find(&a->now, name, strlen(name));
    assert_true(value >= 0);
    return a->now.number[value];
}

// --- text ----------------------------------------------------------------------------------------

struct talk {
    struct profile *profile;
    struct actor actor;
    struct actor_message m;
    int64_t t_ns;
};

static struct talk *talk(const char *text)
{
    struct talk *t = calloc(1, sizeof *t);
    struct gon_error err = {.text = ""};
    t->profile = parse(text);
    if (actor_init(&t->actor, t->profile, 0, &err))
        fail_msg("%s", err.text);
    actor_message_init(&t->m, &t->actor);
    return t;
}

static void hush(struct talk *t)
{
    free(t->profile);
    free(t);
}

// Says it, and hears exactly that within a second; the next one comes a second later.
static void hears(struct talk *t, const char *command, const char *expected)
{
    char heard[2000] = "";
    size_t size = 0;
    uint8_t bytes[PORT_REPLY_MOST];
    port_feed(&t->m.port, (const uint8_t *)command, strlen(command), t->t_ns);
    t->t_ns += MS(1000);
    for (size_t n; (n = port_take(&t->m.port, t->t_ns, bytes, NULL)) > 0; size += n)
        memcpy(heard + size, bytes, n);
    heard[size] = 0;
    assert_string_equal(heard, expected);
}

static const char laser[] = ASKED(
    "emission") "values: ( { name = \"emission\"; type = \"int\"; max = 1; },\n"
                "  { name = \"setpoint_w\"; max = 0.5; }, { name = \"power_w\"; },\n"
                "  { name = \"power_mw\"; scale = 1e-3; },\n"
                "  { name = \"interlock\"; type = \"int\"; max = 1; },\n"
                "  { name = \"mode\"; type = \"int\"; words = ( \"off\", \"warming\", \"on\" ); "
                "},\n"
                "  { name = \"temperature\"; }, { name = \"model\"; type = \"string\"; } );\n"
                "framing: { end_out = \"\\r\"; end_in = \"\\r\\n\"; gap_ms = 100; };\n"
                "exchanges: ( { name = \"emission\"; send = \"l?\"; answer = \"{emission}\"; },\n"
                "  { name = \"power\"; send = \"pa?\"; answer = \"{power_w:.5f}\"; },\n"
                "  { name = \"setpoint\"; send = \"p?\"; answer = \"{setpoint_w:.4f}\"; },\n"
                "  { name = \"set\"; send = \"p {setpoint_w:.4f}\"; answer = \"OK\"; },\n"
                "  { name = \"mode\"; send = \"gom?\"; answer = \"{mode}\"; },\n"
                "  { name = \"model\"; send = \"glm?\"; answer = \"{model}[ ]\"; },\n"
                "  { name = \"on\"; send = \"l1\"; answer = \"OK\"; then = \"emission = 1, mode = "
                "warming\"; },\n"
                "  { name = \"off\"; send = \"l0\"; answer = \"OK\"; then = \"emission = 0\"; },\n"
                "  { name = \"abort\"; send = \"l0\"; then = \"mode = off\"; } );\n"
                "refusals: ( { like = \"busy*\"; means = \"busy\"; }, { like = \"Syntax error*\"; "
                "},\n"
                "  { like = \"error*\"; } );\n"
                "simulate: { start = ( { value = \"setpoint_w\"; is = \"0.1\"; },\n"
                "    { value = \"model\"; is = \"1064-05\"; } );\n"
                "  drift = ( { value = \"temperature\"; when = \"mode = warming\"; to = \"30\"; "
                "rate = 10;\n"
                "      then = \"mode = on\"; },\n"
                "    { value = \"power_w\"; when = \"mode = on\"; to = \"setpoint_w\"; rate = "
                "0.05; "
                "},\n"
                "    { value = \"power_w\"; when = \"emission = 0\"; to = \"0\"; } );\n"
                "  deny = ( { does = \"on\"; when = \"interlock = 1\"; answer = \"Error: "
                "interlock\"; } );\n"
                "  reply_ms = 5; };\n";

static void a_laser_answers_as_its_profile_says(void **state)
{
    (void)state;
    struct talk *t = talk(laser);
    hears(t, "l?\r", "0\r\n");
    hears(t, "glm?\r", "1064-05 \r\n");
    hears(t, "p?\r", "0.1000\r\n");
    hears(t, "\r\n p 0.25\r", "OK\r\n");
    hears(t, "p?\r", "0.2500\r\n");
    hears(t, "p 0.6\r", "Syntax error\r\n"); // beyond its range; nothing else is known to be said
    hears(t, "p?\r", "0.2500\r\n");
    hears(t, "hello\r", "Syntax error\r\n");
    hears(t, "l", "");
    hears(t, "?\r", "0\r\n"); // in two parts
    hush(t);
}

static void an_answer_takes_its_time_and_early_commands_are_ignored(void **state)
{
    (void)state;
    struct talk *t = talk(laser);
    uint8_t bytes[PORT_REPLY_MOST];
    port_feed(&t->m.port, (const uint8_t *)"l?\r", 3, MS(100));
    assert_int_equal(port_take(&t->m.port, MS(104.9), bytes, NULL), 0);
    assert_int_equal(port_take(&t->m.port, MS(105), bytes, NULL), 3);
    port_feed(&t->m.port, (const uint8_t *)"l?\r", 3, MS(199));
    port_feed(&t->m.port, (const uint8_t *)"l?\r", 3, MS(200));
    assert_int_equal(port_take(&t->m.port, MS(300), bytes, NULL), 3);
    assert_int_equal(port_take(&t->m.port, MS(300), bytes, NULL), 0);
    assert_int_equal(t->actor.too_early, 1);
    hush(t);
}

static void values_go_where_they_should_in_time(void **state)
{
    (void)state;
    for (int often = 0; often < 2; often++) { // looked at all the time, or once at the end
        struct talk *t = talk(laser);
        hears(t, "l1\r", "OK\r\n"); // at 0: warm at 3 s, at full power at 5 s
        for (int i = 0; often && i < 3000; i++)
            actor_step(&t->actor, MS(i));
        actor_step(&t->actor, MS(2999.999));
        assert_float_equal(number(&t->actor, "mode"), 1, 0);
        actor_step(&t->actor, MS(3000));
        assert_float_equal(number(&t->actor, "mode"), 2, 0);
        for (int i = 3000; often && i < 4000; i++)
            actor_step(&t->actor, MS(i));
        actor_step(&t->actor, MS(4000));
        assert_float_equal(number(&t->actor, "power_w"), 0.05, 1e-9);
        actor_step(&t->actor, MS(60000));
        assert_float_equal(number(&t->actor, "power_w"), 0.1, 0);
        t->t_ns = MS(70000);
        hears(t, "pa?\r", "0.10000\r\n");
        hears(t, "l0\r", "OK\r\n"); // of both exchanges with this command
        hears(t, "gom?\r", "0\r\n");
        hears(t, "pa?\r", "0.00000\r\n"); // at once
        actor_power_cycle(&t->actor, t->t_ns);
        assert_float_equal(number(&t->actor, "temperature"), 0, 0);
        hush(t);
    }
}

static void what_follows_an_arrival_begins_at_its_very_time(void **state)
{
    (void)state;
    struct talk *t = talk(laser);
    t->profile->simulate.drift[0].rate = 7; // warm after 30/7 s
    hears(t, "l1\r", "OK\r\n");
    actor_step(&t->actor, MS(5000));
    double expected = 0.05 * (5 - 30 / 7.0);
    assert_true(fabs(number(&t->actor, "power_w") - expected) < 1e-9);
    hush(t);
}

static void what_is_denied_is_not_done(void **state)
{
    (void)state;
    struct talk *t = talk(laser);
    struct gon_error err;
    assert_int_equal(actor_set(&t->actor, "interlock = 1", 0, &err), 0);
    hears(t, "l1\r", "Error: interlock\r\n");
    hears(t, "l?\r", "0\r\n");
    assert_int_equal(actor_set(&t->actor, "interlock = 0", t->t_ns, &err), 0);
    hears(t, "l1\r", "OK\r\n");
    hears(t, "l?\r", "1\r\n");
    assert_int_equal(actor_set(&t->actor, "interlok = 0", t->t_ns, &err), GON_E_INPUT);
    hush(t);
}

static void an_ok_line_follows_every_good_answer(void **state)
{
    (void)state;
    struct talk *t = talk(ASKED(
        "status") "values: ( { name = \"state\"; type = \"word\"; words = ( \"OFF\", \"ON\" ); "
                  "},\n"
                  "  { name = \"status\"; type = \"hex\";\n"
                  "    bits = ( { name = \"emission\"; bit = 1; }, { name = \"fault\"; bit = 0; } "
                  "); },\n"
                  "  { name = \"base_c\"; } );\n"
                  "framing: { end_out = \"\\r\\n\"; end_in = \"\\r\\n\"; ok_line = \"OK\"; };\n"
                  "exchanges: ( { name = \"set\"; send = \"AM:STAT {state}\"; then = "
                  "\"status.emission = state\"; },\n"
                  "  { name = \"get\"; send = \"AM:STAT?\"; answer = \"{state}\"; },\n"
                  "  { name = \"clear\"; send = \"*CLS\"; answer = \"OK\"; then = \"status = 0\"; "
                  "},\n"
                  "  { name = \"status\"; send = \"STAT?\"; answer = \"{status:08X}\";\n"
                  "    then = \"status.fault = 0\"; },\n"
                  "  { name = \"base\"; send = \"BAS?\"; answer = \"{base_c:.1f}C\"; } );\n"
                  "refusals: ( { like = \"ERR-100*\"; } );\n"
                  "simulate: { start = ( { value = \"base_c\"; is = \"25.3\"; },\n"
                  "  { value = \"status\"; is = \"0x8001\"; } ); };\n");
    hears(t, "AM:STAT?\r\n", "OFF\r\nOK\r\n");
    hears(t, "BAS?\r\n", "25.3C\r\nOK\r\n");
    hears(t, "STAT?\r\n", "00008001\r\nOK\r\n"); // is cleared by reading: after the answer
    hears(t, "STAT?\r\n", "00008000\r\nOK\r\n");
    hears(t, "AM:STAT ON\r\n", "OK\r\n");
    hears(t, "STAT?\r\n", "00008002\r\nOK\r\n");
    hears(t, "*CLS\r\n", "OK\r\n"); // once
    hears(t, "AM:STAT AUTO\r\n", "ERR-100\r\n");
    hush(t);
}

static void a_command_is_repeated_before_its_answer_and_prompt(void **state)
{
    (void)state;
    struct talk *t = talk(
        ASKED("get") "values: ( { name = \"freq\"; type = \"int\"; min = 20; max = 1000; } );\n"
                     "framing: { end_out = \"\\r\"; end_in = \"\\r> \"; echo_end = \"\\r\"; };\n"
                     "exchanges: ( { name = \"get\"; send = \"freq?\"; answer = \"{freq}\"; },\n"
                     "  { name = \"set\"; send = \"freq={freq}\"; } );\n"
                     "simulate: { deny = ( { answer = \"CMD_NOT_DEFINED\"; } ); };\n");
    hears(t, "freq?\r", "freq?\r20\r> "); // the least it can be
    hears(t, "freq=400\r", "freq=400\r> ");
    hears(t, "freq?\r", "freq?\r400\r> ");
    hears(t, "freq=19\r", "freq=19\rCMD_NOT_DEFINED\r> ");
    hush(t);
}

static void silence_and_an_error_bit_for_what_is_not_known(void **state)
{
    (void)state;
    struct talk *t = talk(ASKED(
        "esr") "values: ( { name = \"esr\"; type = \"int\"; bits = ( { name = \"command\"; bit "
               "= 5; } ); },\n"
               "  { name = \"x_v\"; }, { name = \"aux_v\"; },\n"
               "  { name = \"full_scale_v\"; ladder = ( 2e-9, 5e-9, 1e-8 ); } );\n"
               "framing: { end_out = \"\\r\"; end_in = \"\\r\"; };\n"
               "exchanges: ( { name = \"esr\"; send = \"*ESR?\"; answer = \"{esr}\"; then = "
               "\"esr = 0\"; },\n"
               "  { name = \"snap\"; send = \"SNAP? 1,5\"; answer = \"{x_v:.6g},{aux_v:.6g}\"; "
               "},\n"
               "  { name = \"sens\"; send = \"SENS {full_scale_v}\"; },\n"
               "  { name = \"range\"; send = \"SENS?\"; answer = \"{full_scale_v}\"; } );\n"
               "simulate: { start = ( { value = \"x_v\"; is = \"0.951359\"; } );\n"
               "  deny = ( { then = \"esr.command = 1\"; } ); };\n");
    hears(t, "SNAP?1,5\r", "0.951359,0\r");
    hears(t, "SENS 2\r", "");
    hears(t, "SENS?\r", "2\r");
    assert_float_equal(number(&t->actor, "full_scale_v"), 1e-8, 0);
    hears(t, "*ESR?\r", "0\r");
    hears(t, "SENS 27\r", "");
    hears(t, "*ESR?\r", "32\r");
    hears(t, "*ESR?\r", "0\r");
    hush(t);
}

static void lines_carry_checksums_even_raw_ones(void **state)
{
    (void)state;
#define SUMMED(form, more)                                                                         \
    ASKED("get")                                                                                   \
    "values: ( { name = \"x\"; type = \"int\"; max = 9; } );\n"                                    \
    "framing: { end_out = \"\\r\"; end_in = \"\\r\"; };\n"                                         \
    "checksum: { kind = \"sum\"; form = \"" form "\"; " more " };\n"                               \
    "exchanges: ( { name = \"get\"; send = \"x?\"; answer = \"{x}\"; },\n"                         \
    "  { name = \"set\"; send = \"_~{x}\"; } );\n"
    struct talk *t = talk(SUMMED("hex-upper", "before = \"*\";"));
    hears(t, "x?*B7\r", "0*30\r");
    hears(t, "x?*B8\r", ""); // broken on its way: nothing is done or said
    hears(t, "x?\r", "");
    hears(t, "x?*B7\r", "0*30\r");
    hush(t);
    t = talk(SUMMED("raw-high", ""));
    hears(t, "x?\xb7\r", "00\r");
    // '_' + '~' + '0' is 0x10d, whose lower byte is the end of a line
    hears(t, "_~5\x12\r", "");
    hears(t, "x?\xb7\r", "5\x35\r");
    hears(t, "_~0\x0d\r", "");
    hears(t, "x?\xb7\r", "00\r");
    hush(t);
}

// --- registers -----------------------------------------------------------------------------------

static const char axis[] = HEAD("modbus", "axis",
                                "status = ( \"output\", \"position\" ); position = \"position\"; "
                                "moving = \"output.moving\"; "
                                "in_position = \"not output.moving\"; move = \"move\"; stop = "
                                "\"stop\";") "values: ( { name = \"type\"; type = \"int\"; address "
                                             "= 0x5a; format = \"u32\"; min "
                                             "= 1; max = 3; },\n"
                                             "  { name = \"target\"; type = \"int\"; address = "
                                             "0x5c; format = \"s32\"; },\n"
                                             "  { name = \"speed\"; type = \"int\"; address = "
                                             "0x5e; format = \"s32\"; min = 0; "
                                             "max = 4000000; },\n"
                                             "  { name = \"trigger\"; type = \"int\"; address = "
                                             "0x60; format = \"s32\"; min = -7; "
                                             "max = 1; },\n"
                                             "  { name = \"input\"; type = \"hex\"; address = "
                                             "0x7d; bits = ( { name = \"home\"; "
                                             "bit = 4; },\n"
                                             "    { name = \"stop\"; bit = 5; } ); },\n"
                                             "  { name = \"output\"; type = \"hex\"; address = "
                                             "0x7f; access = \"r\";\n"
                                             "    bits = ( { name = \"moving\"; bit = 13; }, { "
                                             "name = \"homed\"; bit = 4; } ); "
                                             "},\n"
                                             "  { name = \"position\"; type = \"int\"; address = "
                                             "0xcc; format = \"s32\"; access = "
                                             "\"r\"; },\n"
                                             "  { name = \"temperature\"; address = 0x100; format "
                                             "= \"f32\"; word_order = "
                                             "\"low-first\"; },\n"
                                             "  { name = \"volts\"; type = \"int\"; address = "
                                             "0x102; format = \"s16\"; scale = "
                                             "0.1; },\n"
                                             "  { name = \"alarm\"; type = \"int\"; address = "
                                             "0x104; access = \"r\"; },\n"
                                             "  { name = \"lamp\"; type = \"int\"; table = "
                                             "\"coil\"; address = 3; max = 1; },\n"
                                             "  { name = \"door\"; type = \"int\"; table = "
                                             "\"discrete\"; address = 9; access = "
                                             "\"r\"; },\n"
                                             "  { name = \"serial\"; type = \"int\"; table = "
                                             "\"input\"; address = 1; access = "
                                             "\"r\"; },\n"
                                             "  { name = \"homing\"; type = \"int\"; table = "
                                             "\"none\"; } );\n"
                                             "registers: { gap_most = 1; };\n"
                                             "writes: ( { name = \"move\"; set = ( \"type = 1\", "
                                             "\"target = $position\", \"speed "
                                             "= $speed\",\n"
                                             "      \"trigger = 1\" ); then = \"output.moving = 1, "
                                             "trigger = 0, homing = 0\"; },\n"
                                             "  { name = \"stop\"; edge = \"input.stop\"; then = "
                                             "\"output.moving = 0, homing = "
                                             "0\"; },\n"
                                             "  { name = \"home\"; edge = \"input.home\";\n"
                                             "    then = \"output.moving = 1, output.homed = 0, "
                                             "homing = 1, target = 0, speed = "
                                             "100\"; } );\n"
                                             "simulate: { start = ( { value = \"position\"; is = "
                                             "\"-50\"; }, { value = "
                                             "\"serial\"; is = \"77\"; } );\n"
                                             "  drift = ( { value = \"position\"; when = "
                                             "\"output.moving\"; to = \"target\";\n"
                                             "      rate_value = \"speed\"; then = \"output.moving "
                                             "= 0, output.homed = homing, "
                                             "homing = 0\"; } );\n"
                                             "  deny = ( { does = \"move\"; when = \"alarm != 0\"; "
                                             "},\n"
                                             "    { does = \"move\"; when = \"homing = 1\"; answer "
                                             "= \"6\"; } ); };\n";

struct unit {
    struct profile *profile;
    struct actor actor;
    struct sim_modbus_unit u;
    int64_t t_ns;
};

static struct unit *unit(const char *text)
{
    struct unit *u = calloc(1, sizeof *u);
    struct gon_error err = {.text = ""};
    u->profile = parse(text);
    if (actor_init(&u->actor, u->profile, 0, &err))
        fail_msg("%s", err.text);
    u->u = actor_registers_unit(&u->actor, 1);
    return u;
}

static void drop(struct unit *u)
{
    free(u->profile);
    free(u);
}

static int put(struct unit *u, int address, int count, const uint16_t *r)
{
    return u->u.write(u->u.ctx, address, count, r, u->t_ns);
}

static int32_t get(struct unit *u, int address)
{
    uint16_t r[2];
    assert_int_equal(u->u.read(u->u.ctx, address, 2, r, u->t_ns), 0);
    return (int32_t)((uint32_t)r[0] << 16 | r[1]);
}

static uint16_t get_one(struct unit *u, int address)
{
    uint16_t r;
    assert_int_equal(u->u.read(u->u.ctx, address, 1, &r, u->t_ns), 0);
    return r;
}

static int move(struct unit *u, int32_t to, int speed, int trigger)
{
    assert_int_equal(put(u, 0x60, 2, (uint16_t[]){0, 0}), 0);
    uint16_t r[] = {0, 1, (uint16_t)((uint32_t)to >> 16), (uint16_t)to, 0, (uint16_t)speed};
    int rc = put(u, 0x5a, 6, r);
    return rc ? rc : put(u, 0x60, 2, (uint16_t[]){0, (uint16_t)trigger});
}

static void values_lie_in_registers_as_described(void **state)
{
    (void)state;
    struct unit *u = unit(axis);
    struct gon_error err;
    uint16_t r[4], bit;
    assert_int_equal(get(u, 0xcc), -50);
    assert_int_equal(get_one(u, 0xcc), 0xffff); // half of it may be read
    assert_int_equal(actor_set(&u->actor, "temperature = 1.5, volts = -12.3", 0, &err), 0);
    assert_int_equal(u->u.read(u->u.ctx, 0x100, 3, r, 0), 0);
    assert_int_equal(r[0], 0); // 1.5 is 3FC0 0000; here the lower word comes first
    assert_int_equal(r[1], 0x3fc0);
    assert_int_equal(r[2], (uint16_t)-123);
    assert_int_equal(put(u, 0x100, 3, (uint16_t[]){0x8000, 0xc2f6, 456}), 0);
    assert_float_equal(number(&u->actor, "temperature"), -123.25, 0);
    assert_float_equal(number(&u->actor, "volts"), 45.6, 1e-12);
    assert_int_equal(put(u, 0x102, 1, (uint16_t[]){(uint16_t)-7}), 0);
    assert_float_equal(number(&u->actor, "volts"), -0.7, 1e-12);
    assert_int_equal(put(u, 0x102, 1, (uint16_t[]){456}), 0);
    assert_int_equal(u->u.tables->read(u->u.ctx, MODBUS_INPUTS, 1, 1, r, 0), 0);
    assert_int_equal(r[0], 77);
    bit = 1;
    assert_int_equal(u->u.tables->write_coils(u->u.ctx, 3, 1, &bit, 0), 0);
    assert_float_equal(number(&u->actor, "lamp"), 1, 0);
    assert_int_equal(u->u.tables->read(u->u.ctx, MODBUS_COILS, 3, 1, r, 0), 0);
    assert_int_equal(r[0], 1);
    assert_int_equal(u->u.tables->read(u->u.ctx, MODBUS_DISCRETES, 9, 1, r, 0), 0);
    assert_int_equal(r[0], 0);
    u->profile->registers.byte_order = PROFILE_LOW_FIRST;
    u->profile->registers.base = 1;
    assert_int_equal(get_one(u, 0x101), 0xc801); // 456 at 0x102, as the manual then counts
    u->profile->registers.base = 40001;          // each table by its own numbers
    u->profile->values[8].address = 40259;
    u->profile->values[12].address = 30078;
    assert_string_equal(u->profile->values[12].name, "serial");
    assert_int_equal(get_one(u, 0x102), 0xc801);
    assert_int_equal(u->u.tables->read(u->u.ctx, MODBUS_INPUTS, 77, 1, r, 0), 0);
    assert_int_equal(r[0], 77 << 8);
    drop(u);
}

static void exceptions_where_nothing_is_or_may_be(void **state)
{
    (void)state;
    struct unit *u = unit(axis);
    uint16_t r[8] = {0}, bit = 0;
    assert_int_equal(u->u.read(u->u.ctx, 0x62, 1, r, 0), MODBUS_BAD_ADDRESS);
    assert_int_equal(u->u.read(u->u.ctx, 0x60, 3, r, 0), MODBUS_BAD_ADDRESS);
    assert_int_equal(u->u.read(u->u.ctx, 0x102, 3, r, 0), 0);  // a gap of one may be read along
    assert_int_equal(put(u, 0x102, 2, r), MODBUS_BAD_ADDRESS); // but not written
    assert_int_equal(put(u, 0xcc, 2, r), MODBUS_BAD_ADDRESS);  // can only be read
    assert_int_equal(put(u, 0x5c, 1, r), MODBUS_BAD_VALUE);    // half a value
    assert_int_equal(put(u, 0x5d, 1, r), MODBUS_BAD_VALUE);
    assert_int_equal(put(u, 0x5a, 2, (uint16_t[]){0, 4}), MODBUS_BAD_VALUE); // beyond its range
    assert_int_equal(put(u, 0x5a, 4, (uint16_t[]){0, 4, 0, 9}), MODBUS_BAD_VALUE);
    assert_float_equal(number(&u->actor, "target"), 0, 0); // nothing of it
    assert_int_equal(u->u.tables->write_coils(u->u.ctx, 9, 1, &bit, 0), MODBUS_BAD_ADDRESS);
    assert_int_equal(u->u.tables->read(u->u.ctx, MODBUS_COILS, 9, 1, r, 0), MODBUS_BAD_ADDRESS);
    drop(u);
}

static void a_move_takes_its_time(void **state)
{
    (void)state;
    struct unit *u = unit(axis);
    assert_int_equal(move(u, 950, 500, 1), 0); // in several requests: nothing of the profile's
    assert_false(get_one(u, 0x7f) & 0x2000);
    uint16_t all[] = {0, 1, 0, 950, 0, 500, 0, 0};
    assert_int_equal(put(u, 0x5a, 8, all), 0); // without the trigger
    assert_false(get_one(u, 0x7f) & 0x2000);
    all[7] = 1;
    assert_int_equal(put(u, 0x5a, 8, all), 0);
    assert_int_equal(get(u, 0x60), 0); // the trigger is taken back
    u->t_ns = MS(1000);
    assert_true(get_one(u, 0x7f) & 0x2000);
    assert_int_equal(get(u, 0xcc), 450);
    u->t_ns = MS(1999.9);
    assert_true(get_one(u, 0x7f) & 0x2000);
    u->t_ns = MS(2000);
    assert_false(get_one(u, 0x7f) & 0x2000);
    assert_int_equal(get(u, 0xcc), 950);
    drop(u);
}

static void bits_act_when_they_are_set_and_not_while_they_are(void **state)
{
    (void)state;
    struct unit *u = unit(axis);
    const uint16_t home = 0x10, stop = 0x20, none = 0, both = 0x30;
    assert_int_equal(put(u, 0x7d, 1, &home), 0);
    assert_true(get_one(u, 0x7f) & 0x2000);
    u->t_ns = MS(100);
    assert_int_equal(put(u, 0x7d, 1, &both), 0); // home is not new: it is the stop that acts
    assert_false(get_one(u, 0x7f) & 0x2000);
    u->t_ns = MS(300);
    assert_int_equal(get(u, 0xcc), -40);
    assert_int_equal(put(u, 0x7d, 1, &stop), 0);
    assert_int_equal(put(u, 0x7d, 1, &both), 0); // stop is not new
    assert_true(get_one(u, 0x7f) & 0x2000);
    u->t_ns = MS(700);
    assert_int_equal(get_one(u, 0x7f), 0x10); // at home, and homed
    assert_int_equal(put(u, 0x7d, 1, &none), 0);
    drop(u);
}

static void a_denied_write_is_an_exception(void **state)
{
    (void)state;
    struct unit *u = unit(axis);
    struct gon_error err;
    const uint16_t all[] = {0, 1, 0, 950, 0, 500, 0, 1}, home = 0x10;
    assert_int_equal(put(u, 0x7d, 1, &home), 0);
    assert_int_equal(put(u, 0x5a, 8, all), 6); // the state that counts is the one with what is sent
    assert_int_equal(actor_set(&u->actor, "homing = 0, alarm = 0x30", 0, &err), 0);
    assert_int_equal(put(u, 0x5a, 8, all), MODBUS_FAILURE);
    assert_float_equal(number(&u->actor, "target"), 0, 0);
    assert_int_equal(actor_set(&u->actor, "alarm = 0", 0, &err), 0);
    assert_int_equal(put(u, 0x5a, 8, all), 0);
    drop(u);
}

// --- mistakes ------------------------------------------------------------------------------------

static void a_profile_whose_then_cannot_be_read_is_refused(void **state)
{
    (void)state;
    struct profile *p = parse(laser);
    struct actor a;
    struct gon_error err = {.text = ""};
    strcpy(p->exchanges[6].then, "emision = 1");
    assert_int_equal(actor_init(&a, p, 0, &err), GON_E_INPUT);
    assert_string_equal(err.text,
                        "profile p: on: then: 'emision = 1': there is no value 'emision'");
    free(p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_laser_answers_as_its_profile_says),
        cmocka_unit_test(an_answer_takes_its_time_and_early_commands_are_ignored),
        cmocka_unit_test(values_go_where_they_should_in_time),
        cmocka_unit_test(what_follows_an_arrival_begins_at_its_very_time),
        cmocka_unit_test(what_is_denied_is_not_done),
        cmocka_unit_test(an_ok_line_follows_every_good_answer),
        cmocka_unit_test(a_command_is_repeated_before_its_answer_and_prompt),
        cmocka_unit_test(silence_and_an_error_bit_for_what_is_not_known),
        cmocka_unit_test(lines_carry_checksums_even_raw_ones),
        cmocka_unit_test(values_lie_in_registers_as_described),
        cmocka_unit_test(exceptions_where_nothing_is_or_may_be),
        cmocka_unit_test(a_move_takes_its_time),
        cmocka_unit_test(bits_act_when_they_are_set_and_not_while_they_are),
        cmocka_unit_test(a_denied_write_is_an_exception),
        cmocka_unit_test(a_profile_whose_then_cannot_be_read_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
