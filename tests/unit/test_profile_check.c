// SPDX-License-Identifier: MIT
// uses: drivers base
// Five profiles that are right, and each mistake put into one of them by replacing a text.
#include "drivers/profile_check.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

static const char laser[] =
    "profile: { name = \"lamp-1\"; title = \"Lamp\"; role = \"laser\"; protocol = \"message\";\n"
    "  source = \"invented\"; };\n"
    "values: (\n"
    "  { name = \"emission\"; type = \"int\"; max = 1; },\n"
    "  { name = \"status\"; type = \"hex\"; bits = ( { bit = 0; name = \"fault\"; } ); },\n"
    "  { name = \"setpoint_w\"; unit = \"W\"; max = 2; },\n"
    "  { name = \"model\"; type = \"string\"; access = \"r\"; },\n"
    "  { name = \"state\"; type = \"word\"; words = ( \"OFF\", \"ON\" ); },\n"
    "  { name = \"tau_s\"; ladder = ( 1e-3, 1e-2 ); },\n"
    "  { name = \"code\"; type = \"int\"; }\n"
    ");\n"
    "framing: { end_out = \"\\r\"; end_in = \"\\r\\n\"; gap_ms = 50; timeout_ms = 200;\n"
    "  quiet_ms = 350; sync = \"model\"; };\n"
    "checksum: { kind = \"crc\"; width = 16; polynomial = 0x8005; };\n"
    "exchanges: (\n"
    "  { name = \"model\"; send = \"m?\"; answer = \"{model}\"; },\n"
    "  { name = \"emission\"; send = \"l?\"; answer = \"{emission}\"; believe = \"emission < 2\"; "
    "},\n"
    "  { name = \"status\"; send = \"s?\"; answer = \"{status}\"; },\n"
    "  { name = \"setpoint\"; send = \"p?\"; answer = \"{setpoint_w}\"; },\n"
    "  { name = \"set_power\"; send = \"p {setpoint_w:.3f}\"; answer = \"{setpoint_w}\";\n"
    "    echoes = true; verify = \"setpoint\"; settle_ms = 10; check = true; },\n"
    "  { name = \"on\"; send = \"l1\"; answer = \"OK\"; then = \"emission = 1\"; },\n"
    "  { name = \"error\"; send = \"e?\"; answer = \"{code}\"; },\n"
    "  { name = \"live\"; send = \"k\";\n"
    "    then = \"status.fault = 0, code = emission, emission = not code\"; }\n"
    ");\n"
    "refusals: ( { like = \"error*\"; } );\n"
    "errors: { ask = \"error\"; fine = \"code = 0\"; code = \"code\";\n"
    "  codes = ( { code = 1; text = \"one\"; }, { code = 2; text = \"two\"; } ); };\n"
    "identify: { asks = ( \"model\" ); title = \"Lamp {model}\"; serial = \"model\";\n"
    "  restarted = \"status.fault\"; refuse = ( { when = \"model ~ 'X*'\"; text = \"an X\"; } ); "
    "};\n"
    "laser: {\n"
    "  status = ( \"emission\", \"status\" );\n"
    "  once = ( \"setpoint\" );\n"
    "  light = ( \"emission\" );\n"
    "  emitting = \"emission = 1\";\n"
    "  interlock_closed = \"not status.fault\";\n"
    "  states = ( { when = \"emission = 1\"; is = \"emitting\"; },\n"
    "    { is = \"off\"; } );\n"
    "  setpoint = \"setpoint_w\"; set_power = \"set_power\"; power_most_w = 2;\n"
    "  may_not = ( { when = \"status.fault\"; is = \"fault\"; } );\n"
    "  on = ( { send = \"on\"; } );\n"
    "  off = ( \"\\rl0\" );\n"
    "  off_asks = ( \"emission\" );\n"
    "  is_off = \"emission = 0\";\n"
    "  keepalive: { send = \"live\"; period_ms = 200; };\n"
    "};\n"
    "simulate: { start = ( { value = \"emission\"; is = \"0\"; }, { value = \"model\"; is = \"L\"; "
    "} );\n"
    "  drift = ( { value = \"setpoint_w\"; when = \"emission = 1\"; to = \"1.5\"; rate = 1;\n"
    "    then = \"code = 0\"; } );\n"
    "  deny = ( { does = \"on\"; when = \"status.fault\"; answer = \"error {code}\";\n"
    "    then = \"code = 1\"; } ); };\n"
    "golden: ( { does = \"set_power\"; with = \"setpoint_w = 0.5\"; sent = \"p 0.500\";\n"
    "  received = \"0.5\"; gives = \"setpoint_w = 0.5\"; source = \"manual\"; } );\n";

static const char detector[] =
    "profile: { name = \"meter\"; title = \"Meter\"; role = \"detector\"; protocol = \"message\";\n"
    "  source = \"invented\"; };\n"
    "values: ( { name = \"x\"; unit = \"V\"; }, { name = \"monitor_v\"; },\n"
    "  { name = \"range_v\"; ladder = ( 1.0, 10.0 ); },\n"
    "  { name = \"flags\"; type = \"int\"; } );\n"
    "framing: { end_out = \"\\n\"; end_in = \"\\n\"; };\n"
    "exchanges: ( { name = \"x\"; send = \"x?\"; answer = \"{x}\"; },\n"
    "  { name = \"both\"; send = \"b?\"; answer = \"{x},{monitor_v}\"; },\n"
    "  { name = \"flags\"; send = \"f?\"; answer = \"{flags}\"; },\n"
    "  { name = \"range\"; send = \"r?\"; answer = \"{range_v}\"; },\n"
    "  { name = \"set_range\"; send = \"r {range_v}\"; verify = \"range\"; } );\n"
    "detector: {\n"
    "  full_scale = \"range_v\"; set_range = \"set_range\";\n"
    "  read_range = ( \"range\" );\n"
    "  sample = ( \"x\" );\n"
    "  sample_monitor = ( \"both\" );\n"
    "  signal = \"x\";\n"
    "  monitor = \"monitor_v\";\n"
    "  condition = ( \"flags\" );\n"
    "  flags = ( { when = \"flags has 1\"; is = \"saturated\"; } );\n"
    "};\n";

static const char axis[] =
    "profile: { name = \"motor\"; title = \"Motor\"; role = \"axis\"; protocol = \"modbus\";\n"
    "  source = \"invented\"; };\n"
    "values: (\n"
    "  { name = \"status\"; type = \"hex\"; address = 0x10; access = \"r\";\n"
    "    bits = ( { bit = 0; name = \"moving\"; }, { bit = 15; name = \"alarm\"; } ); },\n"
    "  { name = \"position\"; type = \"int\"; format = \"s32\"; address = 0x12; access = \"r\"; "
    "},\n"
    "  { name = \"goal\"; type = \"int\"; format = \"s32\"; address = 0x20; access = \"w\"; },\n"
    "  { name = \"speed\"; type = \"int\"; format = \"u32\"; address = 0x22; access = \"w\"; },\n"
    "  { name = \"input\"; type = \"hex\"; address = 0x30; access = \"w\";\n"
    "    bits = ( { bit = 5; name = \"stop\"; } ); },\n"
    "  { name = \"door\"; type = \"int\"; table = \"discrete\"; address = 0x10; access = \"r\"; }\n"
    ");\n"
    "registers: { base = 0; };\n"
    "writes: (\n"
    "  { name = \"move\"; set = ( \"goal = $position\", \"speed = $speed\" ); },\n"
    "  { name = \"stop\"; edge = \"input.stop\"; release = \"clear\"; verify = \"not "
    "status.moving\"; },\n"
    "  { name = \"clear\"; set = ( \"input = 0\" ); }\n"
    ");\n"
    "axis: {\n"
    "  status = ( \"status\", \"position\" );\n"
    "  position = \"position\";\n"
    "  moving = \"status.moving\";\n"
    "  alarm = \"status.alarm\";\n"
    "  move = \"move\";\n"
    "  stop = \"stop\";\n"
    "  alarms = ( { code = 0x10; text = \"hot\"; }, { code = 0x11; text = \"stuck\"; } );\n"
    "  watchdog = \"clear\"; watchdog_ms = 500;\n"
    "};\n"
    "golden: (\n"
    "  { does = \"clear\"; sent = \"01 10\"; source = \"manual\"; },\n"
    "  { asks = ( \"position\" ); sent = \"01 03\"; gives = \"position = 1\"; source = \"manual\"; "
    "} );\n";

static const char selector[] =
    "profile: { name = \"shutter\"; title = \"Shutter\"; role = \"selector\"; protocol = "
    "\"message\";\n"
    "  source = \"invented\"; };\n"
    "values: ( { name = \"open\"; type = \"int\"; }, { name = \"other\"; } );\n"
    "framing: { end_out = \"\\r\"; end_in = \"\\r\"; };\n"
    "exchanges: ( { name = \"ask\"; send = \"o?\"; answer = \"{open}\"; }, { name = \"turn\"; send "
    "= \"t\"; } );\n"
    "selector: {\n"
    "  status = ( \"ask\" );\n"
    "  positions = (\n"
    "    { name = \"open\"; when = \"open = 1\"; send = \"turn\"; toggles = true; },\n"
    "    { name = \"closed\"; when = \"open = 0\"; send = \"turn\"; toggles = true; } );\n"
    "  safe = \"closed\";\n"
    "};\n";

static const char inputs[] =
    "profile: { name = \"relay\"; title = \"Relay\"; role = \"inputs\"; protocol = \"modbus\";\n"
    "  source = \"invented\"; };\n"
    "values: ( { name = \"lamp\"; type = \"int\"; table = \"coil\"; address = 1; },\n"
    "  { name = \"temperature_c\"; table = \"input\"; address = 4; access = \"r\"; } );\n"
    "registers: { base = 1; };\n"
    "writes: ( { name = \"hold\"; set = ( \"lamp = 1\" ); } );\n"
    "inputs: { status = ( \"lamp\", \"temperature_c\" );\n"
    "  watchdog = \"hold\"; watchdog_ms = 500; };\n";

// --- how they are tried --------------------------------------------------------------------------

struct heard {
    char text[2000];
    int lines;
};

static void hear(void *ctx, const char *line)
{
    struct heard *h = ctx;
    snprintf(h->text + strlen(h->text), sizeof h->text - strlen(h->text), "%s%s",
             h->lines++ ? "\n" : "", line);
}

static int parse(const char *text, struct heard *ret_heard)
{
    struct profile *p = NULL;
    *ret_heard = (struct heard){0};
    int rc = profile_parse(text, "t", (struct cfg_sink){hear, ret_heard}, &p);
    free(p);
    return rc;
}

static void profiles_that_are_right_are_taken(void **state)
{
    const char *const all[] = {laser, detector, axis, selector, inputs};
    struct heard heard;
    (void)state;
    for (int i = 0; i < 5; i++) {
        if (parse(all[i], &heard) < 0)
            fail_msg("%s", heard.text);
        assert_string_equal(heard.text, "");
    }
}

struct mistake {
    const char *old, *new, *says;
};

static void assert_says(const char *right, const struct mistake *m)
{
    char text[8000];
    struct heard heard;
    const char *at = strstr(right, m->old);
    if (!at)
        fail_msg("the profile does not contain '%s'", m->old);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(at - right), right, m->new, at + strlen(m->old));
    assert_int_equal(parse(text, &heard), GON_E_INPUT);
    if (strcmp(heard.text, m->says) != 0)
        print_error("%s -> %s\n  got      %s\n  expected %s\n", m->old, m->new, heard.text,
                    m->says);
    assert_string_equal(heard.text, m->says);
}

static void values_may_share_registers_when_that_is_meant(void **state)
{
    static const char *const meant[] = {"address = 0x0f; shares = \"status\"",
                                        "table = \"input\"; address = 0x10"};
    char text[8000];
    struct heard heard;
    (void)state;
    const char *at = strstr(axis, "address = 0x12");
    for (int i = 0; i < 2; i++) {
        snprintf(text, sizeof text, "%.*s%s%s", (int)(at - axis), axis, meant[i], at + 14);
        if (parse(text, &heard) < 0)
            fail_msg("%s", heard.text);
    }
}

static void mistakes_in_values_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"name = \"lamp-1\"", "name = \"Lamp 1\"",
         "t:1: profile.name = \"Lamp 1\": allowed: a..z, 0..9 and -"},
        {"{ name = \"status\"; type", "{ name = \"emission\"; type",
         "t:5: values[1].name = \"emission\": is the name of values[0], too\nt:18: "
         "exchanges[2].answer = \"{status}\": there is no such value at '{status}'\nt:25: "
         "exchanges[7].then = \"status.fault = 0, code = emission, emiss...\": there is no value "
         "'status'\nt:31: identify.restarted = \"status.fault\": there is no value 'status'\nt:37: "
         "laser.interlock_closed = \"not status.fault\": there is no value 'status'\nt:41: "
         "laser.may_not[0].when = \"status.fault\": there is no value 'status'\nt:51: "
         "simulate.deny[0].when = \"status.fault\": there is no value 'status'"},
        {"name = \"tau_s\"", "name = \"tau-s\"",
         "t:9: values[5].name = \"tau-s\": not a name: a letter, then letters, digits and _; no "
         "word of conditions"},
        {"name = \"tau_s\"", "name = \"over\"",
         "t:9: values[5].name = \"over\": not a name: a letter, then letters, digits and _; no "
         "word of conditions"},
        {"unit = \"W\"; max = 2", "unit = \"W\"; scale = 0; max = 2",
         "t:6: values[2].scale = 0: makes every number the same"},
        {"unit = \"W\"; max = 2", "unit = \"W\"; min = 3; max = 2",
         "t:6: values[2].min = 3: is above max = 2"},
        {"unit = \"W\"; max = 2", "unit = \"W\"; min = 3",
         "t:6: values[2].min = 3: is above max = 0, which is 0 where it is not given"},
        {"; words = ( \"OFF\", \"ON\" )", "",
         "t:8: values[4].type = \"word\": a word needs its list of words"},
        {"\"OFF\", \"ON\"", "\"OFF\", \"off\"",
         "t:8: values[4].words[1] = \"off\": is in the list already"},
        {"unit = \"W\"; max", "words = ( \"low\" ); max",
         "t:6: values[2].words = ( ... ): only a word or a whole number has words"},
        {"ladder = ( 1e-3, 1e-2 )", "type = \"int\"; ladder = ( 1e-3, 1e-2 ); words = ( \"a\" )",
         "t:9: values[5].ladder = ( ... ): words or a ladder, not both"},
        {"ladder = ( 1e-3, 1e-2 )", "scale = 2; ladder = ( 1e-3, 1e-2 )",
         "t:9: values[5].ladder = ( ... ): a ladder's numbers are listed as they are, without "
         "scale and offset"},
        {"ladder = ( 1e-3, 1e-2 )", "type = \"string\"; ladder = ( 1e-3, 1e-2 )",
         "t:9: values[5].ladder = ( ... ): only a number has a ladder"},
        {"ladder = ( 1e-3, 1e-2 )", "min = 1e-3; max = 5e-3; ladder = ( 1e-3, 1e-2 )",
         "t:9: values[5].ladder[1] = 0.01: is not within min..max"},
        {"1e-3, 1e-2", "1e-3, 1e-3", "t:9: values[5].ladder[1] = 0.001: is in the ladder already"},
        {"unit = \"W\"; max", "bits = ( { bit = 3; name = \"b\"; } ); max",
         "t:6: values[2].bits = ( ... ): only a whole number (int, hex) as the wire carries it has "
         "bits"},
        {"bit = 0; name = \"fault\"; }",
         "bit = 0; name = \"fault\"; }, { bit = 0; name = \"bad\"; }",
         "t:5: values[1].bits[1].bit = 0: has the name 'fault' already"},
        {"bit = 0; name = \"fault\"; }",
         "bit = 0; name = \"fault\"; }, { bit = 1; name = \"fault\"; }",
         "t:5: values[1].bits[1].name = \"fault\": is the name of values[1].bits[0], too"},
        {"unit = \"W\"; max", "valid = \"emision = 1\"; max",
         "t:6: values[2].valid = \"emision = 1\": there is no value 'emision'"},
        {"type = \"int\"; }\n", "type = \"int\"; address = 4; }\n",
         "t:10: values[6].address = 4: a message instrument has no registers"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(laser, &mistakes[i]);
}

static void mistakes_in_framing_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"end_out = \"\\r\"; ", "", "t:12: framing.end_out: missing; it says what ends a command"},
        {"gap_ms = 50;", "gap_ms = 50; echo_end = \"\\r\\n\";",
         "t:12: framing.echo_end = \"\\r\\n\": has end_in in it, so that the repeated command "
         "would be taken for the answer; of an instrument that repeats it as a line of its own switch "
         "the echo off"},
        {"end_in = \"\\r\\n\"; ", "", "t:12: framing.end_in: missing; it says what ends an answer"},
        {"timeout_ms = 200", "timeout_ms = 400",
         "t:13: framing.quiet_ms = 350: below timeout_ms: an answer that is waited for may come "
         "later than this"},
        {"sync = \"model\"", "sync = \"modell\"",
         "t:13: framing.sync = \"modell\": there is no such exchange to ask for"},
        {"sync = \"model\"", "sync = \"live\"",
         "t:13: framing.sync = \"live\": is an exchange without an answer"},
        {"width = 16", "width = 12",
         "t:14: checksum.width = 12: allowed: 8, 16, 32\nt:14: checksum.width = 12: polynomial, "
         "initial and xor_out are wider"},
        {"; polynomial = 0x8005", "", "t:14: checksum.polynomial: missing; a crc has one"},
        {"width = 16", "width = 8",
         "t:14: checksum.width = 8: polynomial, initial and xor_out are wider"},
        {"kind = \"crc\"; width = 16; polynomial = 0x8005", "kind = \"lrc\"; width = 16",
         "t:14: checksum.width = 16: an lrc or xor has 8 bits"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(laser, &mistakes[i]);
}

static void mistakes_in_exchanges_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"{ name = \"status\"; send", "{ name = \"emission\"; send",
         "t:18: exchanges[2].name = \"emission\": is the name of exchanges[1], too\nt:33: "
         "laser.status[1] = \"status\": there is no such exchange to ask for\nt:37: "
         "laser.interlock_closed = \"not status.fault\": nothing that is asked for it brings "
         "status\nt:41: laser.may_not[0].when = \"status.fault\": nothing that is asked for it "
         "brings status"},
        {"name = \"live\"; send = \"k\"", "name = \"live\"; send = \"\"",
         "t:24: exchanges[7].send = \"\": missing; it says the command"},
        {"send = \"p {setpoint_w:.3f}\"", "send = \"p {setpoint_w:.3f\"",
         "t:20: exchanges[4].send = \"p {setpoint_w:.3f\": '}' is missing at "
         "'{setpoint_w:.3f'\nt:21: exchanges[4].echoes = true: nothing that is sent comes "
         "back\nt:21: exchanges[4].verify = \"setpoint\": reads back nothing that this one "
         "sends\nt:40: laser.set_power = \"set_power\": does not send the setpoint, "
         "setpoint_w\nt:53: golden[0].with = \"setpoint_w = 0.5\": setpoint_w is not in what is "
         "sent"},
        {"answer = \"{code}\"", "answer = \"{cod}\"",
         "t:23: exchanges[6].answer = \"{cod}\": there is no such value at '{cod}'"},
        {"send = \"e?\"", "send = \"e {model}\"",
         "t:23: exchanges[6].send = \"e {model}\": model is only read (access)"},
        {"believe = \"emission < 2\"", "believe = \"emission < two\"",
         "t:17: exchanges[1].believe = \"emission < two\": 'two' is neither a number nor a word of "
         "emission nor a value"},
        {"believe = \"emission < 2\"", "believe = \"code < 2\"",
         "t:17: exchanges[1].believe = \"code < 2\": says nothing about what comes"},
        {"send = \"p {setpoint_w:.3f}\"; answer = \"{setpoint_w}\"",
         "send = \"p {setpoint_w:.3f}\"; answer = \"OK\"",
         "t:21: exchanges[4].echoes = true: nothing that is sent comes back\nt:54: golden[0].gives "
         "= \"setpoint_w = 0.5\": setpoint_w is not in the answer"},
        {"verify = \"setpoint\"", "verify = \"set_point\"",
         "t:21: exchanges[4].verify = \"set_point\": there is no such exchange to ask for"},
        {"verify = \"setpoint\"", "verify = \"live\"",
         "t:21: exchanges[4].verify = \"live\": is an exchange without an answer"},
        {"verify = \"setpoint\"", "verify = \"emission\"",
         "t:21: exchanges[4].verify = \"emission\": reads back nothing that this one sends"},
        {"verify = \"setpoint\"; settle_ms = 10; check = true", "settle_ms = 10",
         "t:21: exchanges[4].settle_ms = 10: nothing is asked afterwards"},
        {"ask = \"error\"; fine", "ask = \"\"; fine",
         "t:21: exchanges[4].check = true: there is no errors.ask to ask by"},
        {"then = \"emission = 1\"", "then = \"emission 1\"",
         "t:22: exchanges[5].then = \"emission 1\": '=' is missing behind emission"},
        {"then = \"emission = 1\"", "then = \"emission = on\"",
         "t:22: exchanges[5].then = \"emission = on\": 'on' is not a number"},
        {"then = \"emission = 1\"", "then = \"status.hot = 1\"",
         "t:22: exchanges[5].then = \"status.hot = 1\": status has no bit 'hot'"},
        {"then = \"emission = 1\"", "then = \"emission = not lit\"",
         "t:22: exchanges[5].then = \"emission = not lit\": there is no value 'lit'"},
        {"then = \"emission = 1\"", "then = \"emission = \"",
         "t:22: exchanges[5].then = \"emission = \": emission = what?"},
        {"then = \"emission = 1\"", "then = \"emission = 1 code = 2\"",
         "t:22: exchanges[5].then = \"emission = 1 code = 2\": a comma is missing before 'code'"},
        {"like = \"error*\"", "like = \"**\"",
         "t:27: refusals[0].like = \"**\": fits every answer"},
        {"ask = \"error\"", "ask = \"errors\"",
         "t:28: errors.ask = \"errors\": there is no such exchange to ask for"},
        {"fine = \"code = 0\"", "fine = \"code == 0\"",
         "t:28: errors.fine = \"code == 0\": code is compared with nothing"},
        {"; code = \"code\"", "; code = \"kode\"",
         "t:28: errors.code = \"kode\": there is no such value"},
        {"code = 2; text", "code = 1; text",
         "t:29: errors.codes[1].code = 1: is explained by errors.codes[0], too"},
        {"refusals:", "writes: ( { name = \"go\"; set = ( \"code = 1\" ); } );\nrefusals:",
         "t:27: writes = ( ... ): a message instrument has exchanges instead of writes"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(laser, &mistakes[i]);
}

static void mistakes_in_who_it_is_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"asks = ( \"model\" )", "asks = ( \"modell\" )",
         "t:30: identify.asks[0] = \"modell\": there is no such exchange to ask for\nt:31: "
         "identify.refuse[0].when = \"model ~ 'X*'\": nothing that is asked for it brings "
         "model\nt:30: identify.title = \"Lamp {model}\": nothing in identify.asks brings "
         "model\nt:30: identify.serial = \"model\": nothing in identify.asks brings it"},
        {"title = \"Lamp {model}\"", "title = \"Lamp {model} [v]\"",
         "t:30: identify.title = \"Lamp {model} [v]\": [ ] only stands in an answer"},
        {"title = \"Lamp {model}\"", "title = \"Lamp {code}\"",
         "t:30: identify.title = \"Lamp {code}\": nothing in identify.asks brings code"},
        {"serial = \"model\"", "serial = \"code\"",
         "t:30: identify.serial = \"code\": nothing in identify.asks brings it"},
        {"serial = \"model\"", "serial = \"number\"",
         "t:30: identify.serial = \"number\": there is no such value"},
        {"restarted = \"status.fault\"", "restarted = \"status.power\"",
         "t:31: identify.restarted = \"status.power\": status has no bit 'power'"},
        {"when = \"model ~ 'X*'\"", "when = \"code = 1\"",
         "t:31: identify.refuse[0].when = \"code = 1\": nothing that is asked for it brings code"},
        {"text = \"an X\"", "text = \"\"",
         "t:31: identify.refuse[0].text = \"\": missing; it says why it is refused"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(laser, &mistakes[i]);
}

static void mistakes_in_a_laser_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"status = ( \"emission\", \"status\" )", "status = ( \"emission\", \"stat\" ) ",
         "t:33: laser.status[1] = \"stat\": there is no such exchange to ask for\nt:37: "
         "laser.interlock_closed = \"not status.fault\": nothing that is asked for it brings "
         "status\nt:41: laser.may_not[0].when = \"status.fault\": nothing that is asked for it "
         "brings status"},
        {"once = ( \"setpoint\" )", "once = ( )",
         "t:40: laser.setpoint = \"setpoint_w\": nothing that is asked for it brings it"},
        {"light = ( \"emission\" )", "light = ( )",
         "t:35: laser.light = ( ... ): missing; it says what tells that light comes out\nt:36: "
         "laser.emitting = \"emission = 1\": nothing that is asked for it brings emission"},
        {"light = ( \"emission\" )", "light = ( \"status\" )",
         "t:36: laser.emitting = \"emission = 1\": nothing that is asked for it brings emission"},
        {"emitting = \"emission = 1\"", "emitting = \"\"",
         "t:36: laser.emitting = \"\": missing; it says how light is seen"},
        {"interlock_closed = \"not status.fault\"", "interlock_closed = \"not status.open\"",
         "t:37: laser.interlock_closed = \"not status.open\": status has no bit 'open'"},
        {"states = ( { when = \"emission = 1\"; is = \"emitting\"; },\n    { is = \"off\"; } )",
         "states = ( )", "t:38: laser.states = ( ... ): missing; it says its state"},
        {"{ when = \"emission = 1\"; is = \"emitting\"; }", "{ is = \"emitting\"; }",
         "t:38: laser.states[0].when: always holds, so that those behind it never count"},
        {"{ is = \"off\"; }", "{ when = \"emission = 0\"; is = \"off\"; }",
         "t:39: laser.states[1].when = \"emission = 0\": the last one has to hold always"},
        {"is = \"emitting\"", "is = \"warming\"",
         "t:38: laser.states = ( ... ): none of them is emitting"},
        {"{ when = \"emission = 1\"; is", "{ when = \"code = 1\"; is",
         "t:38: laser.states[0].when = \"code = 1\": nothing that is asked for it brings code"},
        {"setpoint = \"setpoint_w\"; set", "set",
         "t:32: laser.setpoint: missing; it says the value that set_power sends"},
        {"setpoint = \"setpoint_w\"; set", "setpoint = \"emission\"; set",
         "t:40: laser.set_power = \"set_power\": does not send the setpoint, emission"},
        {"set_power = \"set_power\"", "set_power = \"power\"",
         "t:40: laser.set_power = \"power\": there is no such exchange to send"},
        {"; power_most_w = 2", "",
         "t:32: laser.power_most_w: missing; it says the most it can be set"},
        {"setpoint = \"setpoint_w\"; set", "setpoint = \"setpoint_w\"; power = \"power\"; set",
         "t:40: laser.power = \"power\": there is no such value"},
        {"setpoint = \"setpoint_w\"; set", "setpoint = \"setpoint_w\"; fault = \"code\"; set",
         "t:40: laser.fault = \"code\": nothing that is asked for it brings it"},
        {"may_not = ( { when = \"status.fault\"", "may_not = ( { when = \"code = 1\"",
         "t:41: laser.may_not[0].when = \"code = 1\": nothing that is asked for it brings code"},
        {"on = ( { send = \"on\"; } )", "on = ( )",
         "t:42: laser.on = ( ... ): missing; it says what switches it on"},
        {"on = ( { send = \"on\"; } )", "on = ( { send = \"go\"; } )",
         "t:42: laser.on[0].send = \"go\": there is no such exchange to send"},
        {"off = ( \"\\rl0\" )", "off = ( )",
         "t:43: laser.off = ( ... ): missing; it says what switches it off"},
        {"off = ( \"\\rl0\" )", "off = ( \"l0\" )",
         "t:43: laser.off[0] = \"l0\": begins without the terminator that ends a half-sent "
         "command"},
        {"off_asks = ( \"emission\" )", "off_asks = ( )",
         "t:44: laser.off_asks = ( ... ): missing; it says what tells that it is off\nt:45: "
         "laser.is_off = \"emission = 0\": nothing that is asked for it brings emission"},
        {"is_off = \"emission = 0\"", "is_off = \"\"",
         "t:45: laser.is_off = \"\": missing; it says how it is seen that there is no light"},
        {"is_off = \"emission = 0\"", "is_off = \"code = 0\"",
         "t:45: laser.is_off = \"code = 0\": nothing that is asked for it brings code"},
        {"send = \"live\"; period", "send = \"alive\"; period",
         "t:46: laser.keepalive.send = \"alive\": there is no such exchange to send"},
        {"period_ms = 200", "period_ms = 90",
         "t:46: laser.keepalive.period_ms = 90: below 2 gap_ms: nothing else could be said in "
         "between"},
        {"laser: {", "inputs: { status = ( \"status\" ); };\nlaser: {",
         "t:32: inputs = { ... }: but profile.role is laser"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(laser, &mistakes[i]);
}

static void mistakes_in_what_is_simulated_and_golden_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"value = \"emission\"; is", "value = \"emision\"; is",
         "t:48: simulate.start[0].value = \"emision\": there is no such value"},
        {"{ value = \"emission\"; is", "{ value = \"\"; is",
         "t:48: simulate.start[0].value = \"\": missing; it says which value"},
        {"{ value = \"setpoint_w\"; when", "{ value = \"\"; when",
         "t:49: simulate.drift[0].value = \"\": missing; it says which value"},
        {"is = \"0\"", "is = \"no\"", "t:48: simulate.start[0].is = \"no\": 'no' is not a number"},
        {"value = \"setpoint_w\"; when", "value = \"setpoint\"; when",
         "t:49: simulate.drift[0].value = \"setpoint\": there is no such value"},
        {"when = \"emission = 1\"; to", "when = \"emission is 1\"; to",
         "t:49: simulate.drift[0].when = \"emission is 1\": nothing is said about emission"},
        {"to = \"1.5\"", "to = \"power\"",
         "t:49: simulate.drift[0].to = \"power\": 'power' is not a number"},
        {"rate = 1", "rate_value = \"speed\"",
         "t:49: simulate.drift[0].rate_value = \"speed\": there is no such value"},
        {"then = \"code = 0\"", "then = \"kode = 0\"",
         "t:50: simulate.drift[0].then = \"kode = 0\": there is no value 'kode'"},
        {"does = \"on\"; when", "does = \"out\"; when",
         "t:51: simulate.deny[0].does = \"out\": there is no such exchange to send"},
        {"when = \"status.fault\"; answer", "when = \"status.faulty\"; answer",
         "t:51: simulate.deny[0].when = \"status.faulty\": status has no bit 'faulty'"},
        {"answer = \"error {code}\"", "answer = \"error [{code}]\"",
         "t:51: simulate.deny[0].answer = \"error [{code}]\": [ ] only stands in an answer"},
        {"then = \"code = 1\"", "then = \"code = one\"",
         "t:52: simulate.deny[0].then = \"code = one\": 'one' is not a number"},
        {"does = \"set_power\"; with", "does = \"set_powr\"; with",
         "t:53: golden[0].does = \"set_powr\": there is no such exchange to send\nt:53: "
         "golden[0].with = \"setpoint_w = 0.5\": setpoint_w is not in what is sent\nt:54: "
         "golden[0].gives = \"setpoint_w = 0.5\": setpoint_w is not in the answer"},
        {"does = \"set_power\"; with", "does = \"\"; with",
         "t:53: golden[0].does = \"\": missing; it says which exchange it shows\nt:53: "
         "golden[0].with = \"setpoint_w = 0.5\": setpoint_w is not in what is sent\nt:54: "
         "golden[0].gives = \"setpoint_w = 0.5\": setpoint_w is not in the answer"},
        {"with = \"setpoint_w = 0.5\"", "with = \"code = 5\"",
         "t:53: golden[0].with = \"code = 5\": code is not in what is sent"},
        {"gives = \"setpoint_w = 0.5\"", "gives = \"code = 5\"",
         "t:54: golden[0].gives = \"code = 5\": code is not in the answer"},
        {"gives = \"setpoint_w = 0.5\"", "gives = \"setpoint_w = half\"",
         "t:54: golden[0].gives = \"setpoint_w = half\": 'half' is not a number"},
        {"source = \"manual\"", "source = \"\"",
         "t:54: golden[0].source = \"\": missing; it says where these bytes are shown"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(laser, &mistakes[i]);
}

static void mistakes_in_a_detector_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"full_scale = \"range_v\"; ", "",
         "t:12: detector.full_scale: missing; it says the value with the range"},
        {"full_scale = \"range_v\"; ", "full_scale = \"x\"; ",
         "t:13: detector.full_scale = \"x\": nothing that is asked for it brings it\nt:13: "
         "detector.full_scale = \"x\": has no ladder, and detector.ranges is empty: which ranges "
         "are there?"},
        {"; ladder = ( 1.0, 10.0 )", "",
         "t:13: detector.full_scale = \"range_v\": has no ladder, and detector.ranges is empty: "
         "which ranges are there?"},
        {"set_range = \"set_range\"", "set_range = \"range!\"",
         "t:13: detector.set_range = \"range!\": there is no such exchange to send"},
        {"read_range = ( \"range\" )", "read_range = ( )",
         "t:14: detector.read_range = ( ... ): missing; it says what tells the range\nt:13: "
         "detector.full_scale = \"range_v\": nothing that is asked for it brings it"},
        {"sample = ( \"x\" )", "sample = ( )",
         "t:15: detector.sample = ( ... ): missing; it says what is asked for a reading"},
        {"sample = ( \"x\" )", "sample = ( \"flags\" )",
         "t:15: detector.sample[0] = \"flags\": does not bring the signal, x"},
        {"sample_monitor = ( \"both\" )", "sample_monitor = ( \"x\" )",
         "t:16: detector.sample_monitor[0] = \"x\": does not bring the monitor, monitor_v"},
        {"signal = \"x\"", "signal = \"\"",
         "t:17: detector.signal = \"\": missing; it says the value with the signal"},
        {"condition = ( \"flags\" )", "condition = ( )",
         "t:20: detector.flags[0].when = \"flags has 1\": nothing that is asked for it brings "
         "flags"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(detector, &mistakes[i]);
}

static void mistakes_in_registers_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"address = 0x12", "address = 0x0f",
         "t:6: values[1].address = 0x0f: overlaps status at register 0010h; if that is meant: "
         "shares = \"status\""},
        {"address = 0x12", "address = 0x1FFFF",
         "t:6: values[1].address = 0x1FFFF: position: address 131071 is not in its table, which "
         "starts at 0 and has 65536"},
        {"address = 0x12", "address = 0xFFFF",
         "t:6: values[1].address = 0xFFFF: position: address 65535 is not in its table, which "
         "starts at 0 and has 65536"},
        {"base = 0", "base = 17",
         "t:4: values[0].address = 0x10: status: address 16 is not in its table, which starts at "
         "17 and has 65536\nt:11: values[5].address = 0x10: door: address 16 is not in its table, "
         "which starts at 17 and has 65536"},
        {"type = \"hex\"; address = 0x10", "type = \"string\"; address = 0x10",
         "t:5: values[0].bits = ( ... ): only a whole number (int, hex) as the wire carries it has "
         "bits\nt:4: values[0].type = \"string\": registers hold no texts\nt:4: values[0].address "
         "= 0x10: status: a text cannot be in registers"},
        {"bit = 15", "bit = 16", "t:5: values[0].bits[1].bit = 16: its format has bits 0..15"},
        {"type = \"int\"; table = \"discrete\"",
         "type = \"int\"; table = \"discrete\"; bits = ( { bit = 1; name = \"b\"; } )",
         "t:11: values[5].bits[0].bit = 1: its format has bits 0..0"},
        {"table = \"discrete\"; address = 0x10; access = \"r\"",
         "table = \"discrete\"; address = 0x10",
         "t:11: values[5].access: input registers and discrete inputs are only read: \"r\""},
        {"address = 0x10; access = \"r\";\n", "table = \"none\"; access = \"r\";\n",
         "t:20: axis.status[0] = \"status\": has no register (table), and cannot be asked for"},
        {"address = 0x22", "address = 0x22; shares = \"status\"",
         "t:8: values[3].shares = \"status\": does not lie there"},
        {"address = 0x22", "address = 0x22; shares = \"nobody\"",
         "t:8: values[3].shares = \"nobody\": there is no such value"},
        {"registers:", "exchanges: ( { name = \"a\"; send = \"b\"; } );\nregisters:",
         "t:13: exchanges = ( ... ): a Modbus instrument has writes instead of exchanges"},
        {"registers:", "refusals: ( { like = \"b\"; } );\nregisters:",
         "t:13: refusals = ( ... ): a Modbus instrument refuses by exception answers"},
        {"registers:", "framing: { end_out = \"b\"; };\nregisters:",
         "t:13: framing = { ... }: only for message instruments"},
        {"registers:", "checksum: { kind = \"xor\"; };\nregisters:",
         "t:13: checksum = { ... }: Modbus has its own"},
        {"registers:", "errors: { ask = \"status\"; fine = \"\"; };\nregisters:",
         "t:13: errors.ask = \"status\": only for message instruments"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(axis, &mistakes[i]);
}

static void mistakes_in_writes_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"{ name = \"stop\"; edge", "{ name = \"move\"; edge",
         "t:16: writes[1].name = \"move\": is the name of writes[0], too\nt:25: axis.stop = "
         "\"stop\": there is no such write to send"},
        {"set = ( \"goal = $position\", \"speed = $speed\" )", "help = \"moves\"",
         "t:15: writes[0] = { ... }: what it sets, or the edge of a bit: one of both\nt:24: "
         "axis.move = \"move\": does not set anything to $position"},
        {"set = ( \"input = 0\" )", "set = ( \"input = 0\" ); edge = \"input.stop\"",
         "t:17: writes[2] = { ... }: what it sets, or the edge of a bit: one of both"},
        {"\"speed = $speed\"", "\"speed = $pace\"",
         "t:15: writes[0].set[1] = \"speed = $pace\": there is no $pace here"},
        {"\"input = 0\"", "\"input = $position\"",
         "t:17: writes[2].set[0] = \"input = $position\": there is no $position here"},
        {"\"speed = $speed\"", "\"position = 1\"",
         "t:15: writes[0].set[1] = \"position = 1\": position is only read (access), or has no "
         "register"},
        {"\"speed = $speed\"", "\"goal = 1\"",
         "t:15: writes[0].set[1] = \"goal = 1\": goal is set twice"},
        {"address = 0x22", "address = 0x23",
         "t:15: writes[0].set = ( ... ): 4 registers in 0020h..0024h; one transaction writes each "
         "of them once"},
        {"format = \"u32\"; address = 0x22", "table = \"coil\"; address = 0x22",
         "t:15: writes[0].set = ( ... ): speed is in another table; one transaction writes one"},
        {"set = ( \"input = 0\" )", "readback = true; set = ( \"input = 0\" )",
         "t:17: writes[2].readback = true: input is only written (access)"},
        {"edge = \"input.stop\"", "edge = \"input.halt\"",
         "t:16: writes[1].edge = \"input.halt\": input has no bit 'halt'"},
        {"edge = \"input.stop\"", "edge = \"input has 1\"",
         "t:16: writes[1].edge = \"input has 1\": not a bit: VALUE.NAME"},
        {"edge = \"input.stop\"", "edge = \"status.moving\"",
         "t:16: writes[1].edge = \"status.moving\": status is only read (access)"},
        {"set = ( \"input = 0\" )", "set = ( \"input = 0\" ); release = \"stop\"",
         "t:17: writes[2].release = \"stop\": only an edge is taken back"},
        {"release = \"clear\"", "release = \"clean\"",
         "t:16: writes[1].release = \"clean\": there is no such write to send"},
        {"verify = \"not status.moving\"", "verify = \"not moving\"",
         "t:16: writes[1].verify = \"not moving\": behind not stands a bit, VALUE.NAME"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(axis, &mistakes[i]);
}

static void mistakes_in_an_axis_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"status = ( \"status\", \"position\" )", "status = ( \"status\", \"goal\" )",
         "t:20: axis.status[1] = \"goal\": is only written (access), and cannot be asked "
         "for\nt:21: axis.position = \"position\": nothing that is asked for it brings it"},
        {"  position = \"position\"", "  position = \"\"",
         "t:21: axis.position = \"\": missing; it says the value with the position"},
        {"moving = \"status.moving\"", "moving = \"\"",
         "t:22: axis.moving = \"\": missing; it says how it is seen that it moves"},
        {"  move = \"move\"", "  move = \"\"",
         "t:15: writes[0].set[0] = \"goal = $position\": there is no $position here\nt:15: "
         "writes[0].set[1] = \"speed = $speed\": there is no $speed here\nt:24: axis.move = \"\": "
         "missing; it says the write that moves it"},
        {"stop = \"stop\"", "stop = \"\"",
         "t:25: axis.stop = \"\": missing; it says the write that stops it"},
        {"stop = \"stop\"", "stop = \"halt\"",
         "t:25: axis.stop = \"halt\": there is no such write to send"},
        {"alarm = \"status.alarm\"", "alarm = \"door = 1\"",
         "t:23: axis.alarm = \"door = 1\": nothing that is asked for it brings door"},
        {"\"goal = $position\"", "\"goal = 0\"",
         "t:24: axis.move = \"move\": does not set anything to $position"},
        {"code = 0x11", "code = 0x10",
         "t:26: axis.alarms[1].code = 0x10: is explained by axis.alarms[0], too"},
        {"; watchdog_ms = 500", "",
         "t:19: axis.watchdog_ms: missing; it says how often it has to be sent"},
        {"does = \"clear\"", "does = \"clean\"",
         "t:30: golden[0].does = \"clean\": there is no such write to send"},
        {"does = \"clear\"; ", "",
         "t:30: golden[0].does: missing; it says which write, or asks values"},
        {"asks = ( \"position\" )", "does = \"clear\"; asks = ( \"position\" )",
         "t:31: golden[1].asks = ( ... ): a write (does), or values asked for; not both"},
        {"asks = ( \"position\" )", "asks = ( \"goal\" )",
         "t:31: golden[1].asks[0] = \"goal\": is only written (access), and cannot be asked "
         "for\nt:31: golden[1].gives = \"position = 1\": position is not asked for"},
        {"gives = \"position = 1\"", "gives = \"status = 1\"",
         "t:31: golden[1].gives = \"status = 1\": status is not asked for"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(axis, &mistakes[i]);
}

static void mistakes_in_a_selector_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"status = ( \"ask\" )", "status = ( )",
         "t:7: selector.status = ( ... ): missing; it says what is asked for its position\nt:9: "
         "selector.positions[0].when = \"open = 1\": nothing that is asked for it brings "
         "open\nt:10: selector.positions[1].when = \"open = 0\": nothing that is asked for it "
         "brings open"},
        {"name = \"closed\"", "name = \"open\"",
         "t:10: selector.positions[1].name = \"open\": is the name of selector.positions[0], "
         "too\nt:11: selector.safe = \"closed\": there is no such position"},
        {"when = \"open = 1\"", "when = \"\"",
         "t:9: selector.positions[0].when = \"\": missing; it says how it is seen that it is "
         "there"},
        {"when = \"open = 1\"", "when = \"other = 1\"",
         "t:9: selector.positions[0].when = \"other = 1\": nothing that is asked for it brings "
         "other"},
        {"send = \"turn\"", "send = \"go\"",
         "t:9: selector.positions[0].send = \"go\": there is no such exchange to send"},
        {"safe = \"closed\"", "safe = \"shut\"",
         "t:11: selector.safe = \"shut\": there is no such position"},
        {"safe = \"closed\"", "moving = \"other > 0\"",
         "t:11: selector.moving = \"other > 0\": nothing that is asked for it brings other"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(selector, &mistakes[i]);
}

static void mistakes_in_inputs_are_named(void **state)
{
    static const struct mistake mistakes[] = {
        {"\"lamp\", \"temperature_c\"", "\"lamp\", \"door\"",
         "t:7: inputs.status[1] = \"door\": there is no such value to ask for"},
        {"( \"lamp\", \"temperature_c\" )", "( )",
         "t:7: inputs.status = ( ... ): missing; it says the values that are read"},
        {"watchdog = \"hold\"", "watchdog = \"held\"",
         "t:8: inputs.watchdog = \"held\": there is no such write to send"},
        {"; watchdog_ms = 500", "",
         "t:7: inputs.watchdog_ms: missing; it says how often it has to be sent"},
        {"access = \"r\"", "access = \"w\"",
         "t:4: values[1].access = \"w\": input registers and discrete inputs are only read: "
         "\"r\"\nt:7: inputs.status[1] = \"temperature_c\": is only written (access), and cannot "
         "be asked for"},
        {"address = 1", "address = 0",
         "t:3: values[0].address = 0: lamp: address 0 is not in its table, which starts at 1 and "
         "has 65536"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        assert_says(inputs, &mistakes[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(profiles_that_are_right_are_taken),
        cmocka_unit_test(values_may_share_registers_when_that_is_meant),
        cmocka_unit_test(mistakes_in_values_are_named),
        cmocka_unit_test(mistakes_in_framing_are_named),
        cmocka_unit_test(mistakes_in_exchanges_are_named),
        cmocka_unit_test(mistakes_in_who_it_is_are_named),
        cmocka_unit_test(mistakes_in_a_laser_are_named),
        cmocka_unit_test(mistakes_in_what_is_simulated_and_golden_are_named),
        cmocka_unit_test(mistakes_in_a_detector_are_named),
        cmocka_unit_test(mistakes_in_registers_are_named),
        cmocka_unit_test(mistakes_in_writes_are_named),
        cmocka_unit_test(mistakes_in_an_axis_are_named),
        cmocka_unit_test(mistakes_in_a_selector_are_named),
        cmocka_unit_test(mistakes_in_inputs_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
