// SPDX-License-Identifier: MIT
// The settings of a profile, a row each. What their texts may hold, and whether the names in them
// exist, is checked afterwards (profile_check.c).
#include "drivers/profile.h"

#include <stddef.h>

const char *const profile_roles[] = {"laser", "detector", "axis", "selector", "inputs", NULL};
const char *const profile_laser_states[] = {"off",       "warming", "emitting", "interlock",
                                            "needs-key", "fault",   NULL};
const char *const profile_flags[] = {"saturated", "unlocked", "unsettled", NULL};
const char *const profile_meanings[] = {"refused", "busy", "interlock", "key",
                                        "fault",   "fine", NULL};
static const char *const protocols[] = {"message", "modbus", NULL};
static const char *const types[] = {"real", "int", "hex", "string", "word", NULL};
static const char *const tables[] = {"holding", "input", "coil", "discrete", "none", NULL};
static const char *const formats[] = {"u16", "s16", "u32", "s32", "f32", NULL};
static const char *const orders[] = {"high-first", "low-first", NULL};
static const char *const own_orders[] = {"as-registers", "high-first", "low-first", NULL};
static const char *const accesses[] = {"r", "w", "rw", NULL};
static const char *const sums[] = {"none", "crc", "sum", "xor", "lrc", NULL};
static const char *const sum_forms[] = {"hex-upper", "hex-lower", "raw-high", "raw-low", NULL};

#define MEMBER(s, m) sizeof(((struct s *)0)->m)
#define COUNT(s, m) (MEMBER(s, m) / sizeof(((struct s *)0)->m)[0])
#define AT(s, m) .offset = offsetof(struct s, m)
#define TEXT(s, n, m, def, text)                                                                   \
    {                                                                                              \
        .name = n, .type = CFG_STRING, AT(s, m), .size = MEMBER(s, m), .fallback = def,            \
        .help = text                                                                               \
    }
#define BYTES(s, n, m, def, text)                                                                  \
    {                                                                                              \
        .name = n, .type = CFG_BYTES, AT(s, m), .size = MEMBER(s, m), .fallback = def,             \
        .help = text                                                                               \
    }
#define REAL(s, n, m, u, lo, hi, def, text)                                                        \
    {                                                                                              \
        .name = n, .type = CFG_REAL, AT(s, m), .unit = u, .min = lo, .max = hi, .fallback = def,   \
        .help = text                                                                               \
    }
#define WHOLE(s, n, m, u, lo, hi, def, text)                                                       \
    {                                                                                              \
        .name = n, .type = CFG_INT, AT(s, m), .unit = u, .min = lo, .max = hi, .fallback = def,    \
        .help = text                                                                               \
    }
#define HEX(s, n, m, lo, hi, def, text)                                                            \
    {                                                                                              \
        .name = n, .type = CFG_HEX, AT(s, m), .min = lo, .max = hi, .fallback = def, .help = text  \
    }
#define YES(s, n, m, text)                                                                         \
    {                                                                                              \
        .name = n, .type = CFG_BOOL, AT(s, m), .fallback = "false", .help = text                   \
    }
#define CHOICE(s, n, m, list, def, text)                                                           \
    {                                                                                              \
        .name = n, .type = CFG_CHOICE, AT(s, m), .choices = list, .fallback = def, .help = text    \
    }
#define REALS(s, n, m, c, text)                                                                    \
    {                                                                                              \
        .name = n, .type = CFG_REALS, AT(s, m), .size = COUNT(s, m),                               \
        .count_offset = offsetof(struct s, c), .fallback = "", .help = text                        \
    }
#define TEXTS(s, n, m, c, text)                                                                    \
    {                                                                                              \
        .name = n, .type = CFG_STRINGS, AT(s, m), .size = COUNT(s, m), .stride = MEMBER(s, m[0]),  \
        .count_offset = offsetof(struct s, c), .fallback = "", .help = text                        \
    }
#define ASKS(s, n, m, text) TEXTS(s, n, m.name, m.count, text)
#define GROUP(s, n, m, table, text)                                                                \
    {                                                                                              \
        .name = n, .type = CFG_GROUP, AT(s, m), .rows = table, .fallback = "", .help = text        \
    }
#define GROUPS(s, n, m, c, table, text)                                                            \
    {                                                                                              \
        .name = n, .type = CFG_GROUPS, AT(s, m), .size = COUNT(s, m), .stride = MEMBER(s, m[0]),   \
        .count_offset = offsetof(struct s, c), .rows = table, .fallback = "", .help = text         \
    }
#define RULES(s, n, m, table, text) GROUPS(s, n, m.rule, m.count, table, text)

// --- what it is ----------------------------------------------------------------------------------

static const struct cfg_row head_rows[] = {
    TEXT(profile, "name", name, NULL, "What a bench file calls it: the file's name without .cfg."),
    TEXT(profile, "title", title, NULL, "Maker and model, for people."),
    CHOICE(profile, "role", role, profile_roles, NULL, "What it does at the bench."),
    CHOICE(profile, "protocol", protocol, protocols, NULL, "Lines of text, or Modbus registers."),
    TEXT(profile, "link", link, "", "How it is usually connected: an example for a bench file."),
    TEXT(profile, "source", source, NULL, "Where these facts come from: manual and page, or code."),
    TEXTS(profile, "unverified", unverified, unverified_count,
          "What was not checked against the manual, a sentence each."),
    {0}};

// --- values --------------------------------------------------------------------------------------

static const struct cfg_row bit_rows[] = {
    TEXT(profile_bit, "name", name, NULL, "Conditions say VALUE.NAME."),
    WHOLE(profile_bit, "bit", bit, NULL, 0, 31, NULL, "Its number; 0 is the lowest."),
    TEXT(profile_bit, "help", help, "", "What it means."),
    {0}};

static const struct cfg_row value_rows[] = {
    TEXT(profile_value, "name", name, NULL, "What everything else in this file calls it."),
    CHOICE(profile_value, "type", type, types, "\"real\"", "How it is written on the wire."),
    TEXT(profile_value, "unit", unit, "", "Of the number, after scale and offset."),
    REAL(profile_value, "scale", scale, NULL, -1e12, 1e12, "1", "number = wire * scale + offset."),
    REAL(profile_value, "offset", offset, NULL, -1e12, 1e12, "0", "As said there."),
    YES(profile_value, "inverse", inverse, "Instead: number = scale / wire + offset."),
    REAL(profile_value, "min", min, NULL, -1e300, 1e300, "0",
         "The least it can be; beyond it an answer is not believed, and nothing is sent."),
    REAL(profile_value, "max", max, NULL, -1e300, 1e300, "0", "The most. Both equal, or both left out: no limit; give both, as one that is left out "
         "is 0."),
    REAL(profile_value, "resolution", resolution, NULL, 0, 1e300, "0",
         "Of what the wire carries: a read-back may differ by so much."),
    REALS(profile_value, "over", over, over_count,
          "Numbers on the wire that mean: beyond the range."),
    REALS(profile_value, "invalid", invalid, invalid_count,
          "Numbers on the wire that are no measurement."),
    REALS(profile_value, "ladder", ladder, ladder_count,
          "The numbers it can have, in the order of the codes that the wire carries for them."),
    WHOLE(profile_value, "ladder_first", ladder_first, NULL, -1000, 1000, "0",
          "The code of the ladder's or the words' first."),
    TEXTS(profile_value, "words", words, words_count,
          "The words it can be, numbered from ladder_first; of int and hex: names of numbers."),
    GROUPS(profile_value, "bits", bits, bits_count, bit_rows, "Names of its bits."),
    TEXT(profile_value, "valid", valid, "", "Condition without which it means nothing."),
    YES(profile_value, "changes", changes,
        "Never twice the same (a time stamp): an answer that repeats it is an old one."),
    TEXT(profile_value, "help", help, "", "What it is."),
    CHOICE(profile_value, "table", table, tables, "\"holding\"",
           "Modbus: which table; none: what only the simulated instrument knows."),
    HEX(profile_value, "address", address, 0, 165535, "0",
        "Modbus: its (first) register as the manual counts."),
    CHOICE(profile_value, "format", format, formats, "\"u16\"", "Modbus: how registers hold it."),
    CHOICE(profile_value, "word_order", word_order, own_orders, "\"as-registers\"",
           "Modbus: which of two registers comes first."),
    CHOICE(profile_value, "access", access, accesses, "\"rw\"", "Modbus: read, written or both."),
    YES(profile_value, "alone", alone, "Modbus: never read together with its neighbours."),
    TEXT(profile_value, "shares", shares, "",
         "Modbus: the other value in whose registers it lies on purpose."),
    {0}};

// --- messages ------------------------------------------------------------------------------------

static const struct cfg_row framing_rows[] = {
    BYTES(profile_framing, "end_out", end_out, "", "Ends what is sent: \"\\r\"."),
    BYTES(profile_framing, "end_in", end_in, "", "Ends an answer: \"\\r\\n\"."),
    BYTES(profile_framing, "echo_end", echo_end, "",
          "The device repeats each command, followed by this; without it there is no echo. May not "
          "contain end_in."),
    TEXT(profile_framing, "ok_line", ok_line, "",
         "A line that follows every good answer, and is all the answer to a setting."),
    YES(profile_framing, "empty", empty, "An empty line is an answer, too."),
    REAL(
        profile_framing, "gap_ms", gap_ms, "ms", 0, 1000, "0",
        "From an answer to the next command, which may be ignored when it comes sooner; of a laser "
        "also the time in which the answer to an OFF that was not waited for comes."),
    REAL(profile_framing, "timeout_ms", timeout_ms, "ms", 10, 5000, "200",
         "How long an answer may take."),
    REAL(profile_framing, "quiet_ms", quiet_ms, "ms", 10, 5000, "350",
         "Silence after which no late answer comes any more: the largest latency."),
    TEXT(profile_framing, "sync", sync, "", "The exchange that gets into step again."),
    {0}};

static const struct cfg_row checksum_rows[] = {
    CHOICE(profile_checksum, "kind", kind, sums, "\"none\"", "How it is computed."),
    WHOLE(profile_checksum, "width", width, NULL, 8, 32, "8", "Bits: 8, 16 or 32."),
    HEX(profile_checksum, "polynomial", polynomial, 0, 0, "0", "crc: without its highest bit."),
    HEX(profile_checksum, "initial", initial, 0, 0, "0", "crc: the register before."),
    HEX(profile_checksum, "xor_out", xor_out, 0, 0, "0", "crc: put over the result."),
    YES(profile_checksum, "reflect_in", reflect_in, "crc: bytes come lowest bit first."),
    YES(profile_checksum, "reflect_out", reflect_out, "crc: the result is turned round."),
    CHOICE(profile_checksum, "form", form, sum_forms, "\"hex-upper\"", "How it is written."),
    BYTES(profile_checksum, "before", before, "", "Stands between text and checksum: \"*\"."),
    {0}};

static const struct cfg_row exchange_rows[] = {
    TEXT(profile_exchange, "name", name, NULL, "What the roles call it."),
    BYTES(profile_exchange, "send", send, NULL, "The command: a pattern, without its terminator."),
    BYTES(profile_exchange, "answer", answer, "", "The answer: a pattern; without it none comes."),
    TEXT(profile_exchange, "believe", believe, "",
         "Condition over what came; where it does not hold it is asked again."),
    YES(profile_exchange, "echoes", echoes,
        "Values that are sent and come back must be the same; otherwise it was refused."),
    TEXT(profile_exchange, "verify", verify, "", "The exchange that reads back what was set."),
    REAL(profile_exchange, "settle_ms", settle_ms, "ms", 0, 60000, "0", "Before that."),
    REAL(profile_exchange, "timeout_ms", timeout_ms, "ms", 0, 60000, "0",
         "How long its answer may take; 0: as framing says."),
    YES(profile_exchange, "check", check, "Errors are asked for afterwards."),
    TEXT(profile_exchange, "then", then, "",
         "What it changes in the simulated instrument: \"emission = 1, mode = 4\"."),
    TEXT(profile_exchange, "help", help, "", "What it does."),
    {0}};

static const struct cfg_row refusal_rows[] = {
    TEXT(profile_refusal, "like", like, NULL,
         "An answer like this (* and ? as in file names, letter case does not matter) refuses."),
    CHOICE(profile_refusal, "means", means, profile_meanings, "\"refused\"", "Why."),
    {0}};

static const struct cfg_row code_rows[] = {
    WHOLE(profile_code, "code", code, NULL, -2e9, 2e9, NULL, "As the device gives it."),
    TEXT(profile_code, "text", text, NULL, "What it means."),
    CHOICE(profile_code, "means", means, profile_meanings, "\"refused\"", "Of what kind it is."),
    {0}};

static const struct cfg_row alarm_rows[] = {
    HEX(profile_code, "code", code, 0, 65535, NULL, "As the device gives it."),
    TEXT(profile_code, "text", text, NULL, "What it means."),
    {0}};

static const struct cfg_row error_rows[] = {
    TEXT(profile_errors, "ask", ask, NULL, "The exchange that asks for the oldest error."),
    TEXT(profile_errors, "fine", fine, NULL, "Condition: there was none."),
    TEXT(profile_errors, "code", code, "", "The value with its code."),
    GROUPS(profile_errors, "codes", codes, codes_count, code_rows, "What the codes mean."),
    {0}};

// --- Modbus --------------------------------------------------------------------------------------

static const struct cfg_row register_rows[] = {
    WHOLE(profile_registers, "base", base, NULL, 0, 40001, "0",
          "What the manual calls the first register: 0, 1, or 40001 (then inputs start at 30001, "
          "discrete inputs at 10001, coils at 1)."),
    CHOICE(profile_registers, "word_order", word_order, orders, "\"high-first\"",
           "Which of a value's two registers has the lower address."),
    CHOICE(profile_registers, "byte_order", byte_order, orders, "\"high-first\"",
           "Within a register; Modbus says high-first."),
    WHOLE(profile_registers, "block_most", block_most, NULL, 1, 125, "125",
          "Registers that one request may read."),
    WHOLE(profile_registers, "gap_most", gap_most, NULL, 0, 124, "8",
          "Unwanted registers that are read along rather than asking twice."),
    YES(profile_registers, "single", single, "One register is written by function 6, not 16."),
    REAL(profile_registers, "timeout_ms", timeout_ms, "ms", 0, 200, "0",
         "How long its answers may take, where that is longer than the bench's bus allows."),
    REAL(profile_registers, "quiet_ms", quiet_ms, "ms", 20, 1000, "100",
         "The largest latency: silence after which no late answer comes."),
    {0}};

static const struct cfg_row write_rows[] = {
    TEXT(profile_write, "name", name, NULL, "What the roles call it."),
    TEXTS(profile_write, "set", set, set_count,
          "Values and what they become (\"speed = $speed\"), in one transaction; a name alone: "
          "what it was set to."),
    TEXT(profile_write, "edge", edge, "",
         "Instead: a bit (VALUE.BIT) that acts when it is set and is taken back."),
    TEXT(profile_write, "release", release, "",
         "The write that takes the bit back; without one the value is written as 0."),
    YES(profile_write, "readback", readback, "The values are read back and must be the same."),
    TEXT(profile_write, "verify", verify, "", "Condition that must hold afterwards."),
    YES(profile_write, "repeat", repeat, "May be sent again when its answer was lost."),
    TEXT(profile_write, "then", then, "", "What it changes in the simulated instrument."),
    TEXT(profile_write, "help", help, "", "What it does."),
    {0}};

// --- golden --------------------------------------------------------------------------------------

static const struct cfg_row golden_rows[] = {
    TEXT(profile_golden, "does", does, "", "Exchange or write."),
    TEXTS(profile_golden, "asks", asks, asks_count, "Modbus reading: the values asked for."),
    WHOLE(profile_golden, "unit", unit, NULL, 1, 247, "1", "Modbus: the unit's address."),
    TEXT(profile_golden, "with", with, "", "What is set: \"setpoint_w = 0.1\"."),
    BYTES(profile_golden, "sent", sent, NULL,
          "The bytes without terminator; Modbus: an RTU frame in hexadecimal."),
    BYTES(profile_golden, "received", received, "", "The answer, in the same form."),
    TEXT(profile_golden, "gives", gives, "", "What is read from it: \"x = 0.951359\"."),
    TEXT(profile_golden, "source", source, NULL,
         "Manual and page, or public code, that shows it; or that it was recorded, and from what."),
    {0}};

// --- roles ---------------------------------------------------------------------------------------

#define RULE_ROWS(n, list, def, about)                                                             \
    static const struct cfg_row n[] = {                                                            \
        TEXT(profile_rule, "when", when, "", "Condition; without one it always holds."),           \
        CHOICE(profile_rule, "is", is, list, def, about),                                          \
        TEXT(profile_rule, "text", text, "", "For people."),                                       \
        {0}}
RULE_ROWS(state_rows, profile_laser_states, NULL, "The laser's state then.");
RULE_ROWS(flag_rows, profile_flags, NULL, "What is wrong with a reading then.");
RULE_ROWS(meaning_rows, profile_meanings, "\"refused\"", "Of what kind it is.");

static const struct cfg_row send_rows[] = {
    TEXT(profile_rule, "when", when, "", "Condition; without one it always holds."),
    TEXT(profile_rule, "send", send, NULL, "The exchange or write."),
    {0}};

static const struct cfg_row identify_rows[] = {
    ASKS(profile_identify, "asks", asks, "What tells who it is."),
    RULES(profile_identify, "refuse", refuse, meaning_rows,
          "When it is not this instrument, or not one that can be used, and why."),
    BYTES(profile_identify, "title", title, "", "What it is called then: a pattern."),
    TEXT(profile_identify, "serial", serial, "", "The value that tells one unit from another."),
    TEXT(profile_identify, "restarted", restarted, "",
         "Condition that shows, in any answer, that it was switched off and on."),
    {0}};

static const struct cfg_row keepalive_rows[] = {
    TEXT(profile_keepalive, "send", send, NULL, "The exchange."),
    REAL(profile_keepalive, "period_ms", period_ms, "ms", 20, 60000, NULL, "At most so far apart."),
    {0}};

static const struct cfg_row laser_rows[] = {
    ASKS(profile_laser, "status", status, "What all conditions below need."),
    ASKS(profile_laser, "once", once, "What changes only when it is set."),
    ASKS(profile_laser, "light", light, "What \"emitting\" needs, and no more."),
    TEXT(profile_laser, "emitting", emitting, "", "Condition: light comes out, or may."),
    TEXT(profile_laser, "interlock_closed", interlock_closed, "", "Condition."),
    RULES(profile_laser, "states", states, state_rows, "Its state: the first that holds."),
    TEXT(profile_laser, "power", power, "", "The value with the measured power."),
    TEXT(profile_laser, "setpoint", setpoint, "", "The value with the power it is set to."),
    TEXT(profile_laser, "fault", fault, "", "The value with the fault's code."),
    TEXT(profile_laser, "set_power", set_power, "", "What sends the set-point."),
    REAL(profile_laser, "power_most_w", power_most_w, "W", 0, 1000, "0", "The most it can be set."),
    ASKS(profile_laser, "before_on", before_on, "Asked before ON, besides the status."),
    RULES(profile_laser, "may_not", may_not, meaning_rows, "When ON is not even sent, and why."),
    RULES(profile_laser, "prepare", prepare, send_rows, "Sent before ON: all that hold."),
    RULES(profile_laser, "on", on, send_rows, "ON: the first that holds. Sent once."),
    ASKS(profile_laser, "after_refusal", after_refusal, "Asked when ON was refused."),
    RULES(profile_laser, "refusals", refusals, meaning_rows, "Why it was refused."),
    TEXTS(profile_laser, "off", off, off_count,
          "OFF, sent as it stands, in turn until it is read back; it begins with a terminator."),
    ASKS(profile_laser, "off_asks", off_asks, "What \"is_off\" needs."),
    TEXT(profile_laser, "is_off", is_off, "",
         "Condition: no light, and none on its way. Each term speaks of one value, a "
         "word, a whole number, or bits that are missing: more the guard cannot see."),
    GROUPS(profile_laser, "faults", faults, faults_count, code_rows, "What fault codes mean."),
    GROUP(profile_laser, "keepalive", keepalive, keepalive_rows,
          "Sent while emission is on, never else."),
    {0}};

static const struct cfg_row detector_rows[] = {
    RULES(profile_detector, "setup", setup, send_rows, "Sent in this order: all that hold."),
    TEXT(profile_detector, "full_scale", full_scale, "", "The value whose ladder are the ranges."),
    REALS(profile_detector, "ranges", ranges, ranges_count,
          "Full scales, where the wire carries the full scale itself and not a ladder's code."),
    ASKS(profile_detector, "read_range", read_range, "What tells the range."),
    TEXT(profile_detector, "set_range", set_range, "", "What sends it."),
    REAL(profile_detector, "range_settle_ms", range_settle_ms, "ms", 0, 60000, "0",
         "After a change of range nothing is believed for so long."),
    REAL(profile_detector, "settle_s", settle_s, "s", 0, 600, "0",
         "Of the instrument, where it has no time constant that can be set."),
    ASKS(profile_detector, "sample", sample, "One sample; with two, they are asked in turn."),
    ASKS(profile_detector, "sample_monitor", sample_monitor, "The same with a monitor."),
    TEXT(profile_detector, "signal", signal, "", "The value with the signal."),
    TEXT(profile_detector, "monitor", monitor, "", "The value with the monitor's."),
    TEXT(profile_detector, "reference", reference, "", "The value with the reference frequency."),
    REAL(profile_detector, "clipped", clipped, NULL, 0, 10, "0.95",
         "Of full scale: from there on it is saturated."),
    ASKS(profile_detector, "clear", clear, "Asked before a reading: forgets what was."),
    ASKS(profile_detector, "condition", condition, "Asked after a reading."),
    RULES(profile_detector, "flags", flags, flag_rows, "What is wrong with it: all that hold."),
    {0}};

static const struct cfg_row axis_rows[] = {
    ASKS(profile_axis, "status", status, "Values that the settings below need, in this order."),
    TEXT(profile_axis, "position", position, "", "The value with the encoder's position, steps."),
    TEXT(profile_axis, "target", target, "", "The value with the commanded position, steps."),
    TEXT(profile_axis, "alarm_code", alarm_code, "", "The value with the alarm's code; 0: none."),
    TEXT(profile_axis, "moving", moving, "", "Condition."),
    TEXT(profile_axis, "in_position", in_position, "",
         "Condition; without it: that it does not move."),
    TEXT(profile_axis, "ready", ready, "",
         "Condition: it would take a command; without it: that there is no alarm."),
    TEXT(profile_axis, "homed", homed, "", "Condition: it knows where it is."),
    TEXT(profile_axis, "alarm", alarm, "", "Condition."),
    TEXT(profile_axis, "limit", limit, "", "Condition: at a limit switch."),
    TEXT(profile_axis, "following", following, "", "Condition: a following error."),
    TEXT(profile_axis, "move", move, "",
         "The write that moves to $position with $speed and "
         "$acceleration (steps, steps/s, steps/s2)."),
    TEXT(profile_axis, "stop", stop, "", "The write that stops."),
    TEXT(profile_axis, "home", home, "", "The write that looks for home."),
    TEXT(profile_axis, "reset", reset, "", "The write that clears an alarm."),
    TEXT(profile_axis, "enable", enable, "", "The write that switches the motor's current on."),
    TEXT(profile_axis, "clear", clear, "", "The write that takes back command bits left set."),
    REAL(profile_axis, "speed_least", speed_least, "steps/s", 1, 1e9, "1", "The least."),
    REAL(profile_axis, "speed_most", speed_most, "steps/s", 1, 1e12, "1000000", "The most."),
    REAL(profile_axis, "acceleration_most", acceleration_most, "steps/s2", 1, 1e12, "1000000000",
         "The most."),
    GROUPS(profile_axis, "alarms", alarms, alarms_count, alarm_rows, "What alarms mean."),
    TEXT(profile_axis, "watchdog", watchdog, "", "The write that has to be repeated."),
    REAL(profile_axis, "watchdog_ms", watchdog_ms, "ms", 0, 60000, "0", "At most so far apart."),
    {0}};

static const struct cfg_row position_rows[] = {
    TEXT(profile_position, "name", name, NULL, "What it is called: \"open\", \"1\"."),
    TEXT(profile_position, "when", when, NULL, "Condition: it is there."),
    TEXT(profile_position, "send", send, NULL, "What takes it there; sent only while it is not."),
    YES(profile_position, "toggles", toggles,
        "What is sent only changes over: never sent before the state was read."),
    {0}};

static const struct cfg_row selector_rows[] = {
    ASKS(profile_selector, "status", status, "What the conditions need."),
    GROUPS(profile_selector, "positions", positions, positions_count, position_rows,
           "Where it can be."),
    TEXT(profile_selector, "moving", moving, "", "Condition: on its way."),
    REAL(profile_selector, "timeout_s", timeout_s, "s", 0.1, 600, "10", "For one change."),
    TEXT(profile_selector, "safe", safe, "", "The position that is safe: a shutter's \"closed\"."),
    RULES(profile_selector, "setup", setup, send_rows, "Sent at first: all that hold."),
    {0}};

static const struct cfg_row input_rows[] = {
    ASKS(profile_inputs, "status", status, "The values that are read."),
    TEXT(profile_inputs, "watchdog", watchdog, "", "The write that has to be repeated."),
    REAL(profile_inputs, "watchdog_ms", watchdog_ms, "ms", 0, 60000, "0", "At most so far apart."),
    {0}};

// --- the simulated instrument --------------------------------------------------------------------

static const struct cfg_row start_rows[] = {
    TEXT(profile_start, "value", value, NULL, "Its name."),
    TEXT(profile_start, "is", is, NULL, "Number, word or text, in quotes."),
    {0}};

static const struct cfg_row drift_rows[] = {
    TEXT(profile_drift, "value", value, NULL, "What changes by itself."),
    TEXT(profile_drift, "when", when, "", "Condition."),
    TEXT(profile_drift, "to", to, NULL, "Where to: a number or a value's name."),
    REAL(profile_drift, "rate", rate, NULL, 0, 1e12, "0", "A second; 0: at once."),
    TEXT(profile_drift, "rate_value", rate_value, "", "Or as fast as this value says."),
    TEXT(profile_drift, "then", then, "", "What it changes once it is there."),
    {0}};

static const struct cfg_row deny_rows[] = {
    TEXT(profile_deny, "does", does, "",
         "Exchange or write; without one: what is not known or beyond its range."),
    TEXT(profile_deny, "when", when, "", "Condition."),
    BYTES(profile_deny, "answer", answer, "",
          "What it says instead: a pattern; without one nothing. Modbus: the exception's number."),
    TEXT(profile_deny, "then", then, "", "What it changes."),
    {0}};

static const struct cfg_row follow_rows[] = {
    TEXT(profile_follow, "when", when, "", "Condition; without one it always holds."),
    TEXT(profile_follow, "then", then, NULL, "What is so as long as it holds."),
    {0}};

static const struct cfg_row simulate_rows[] = {
    GROUPS(profile_simulate, "start", start, start_count, start_rows, "When the power comes on."),
    GROUPS(profile_simulate, "drift", drift, drift_count, drift_rows, "What goes by itself."),
    GROUPS(profile_simulate, "follows", follows, follows_count, follow_rows,
           "What is always so while something else is: the flag of an overload."),
    TEXT(profile_simulate, "shines", shines, "",
         "Condition: the laser's light leaves it; without one: laser.emitting."),
    GROUPS(profile_simulate, "deny", deny, deny_count, deny_rows, "What it refuses."),
    REAL(profile_simulate, "reply_ms", reply_ms, "ms", 0, 5000, "2", "Its time to answer."),
    {0}};

// --- all of it -----------------------------------------------------------------------------------

const struct cfg_row profile_schema[] = {
    {.name = "profile", .type = CFG_GROUP, .rows = head_rows, .help = "What it is."},
    GROUPS(profile, "values", values, values_count, value_rows,
           "Everything it can say or be told."),
    GROUP(profile, "framing", framing, framing_rows, "Messages: how lines begin and end."),
    GROUP(profile, "checksum", checksum, checksum_rows, "Messages: behind each line."),
    GROUPS(profile, "exchanges", exchanges, exchanges_count, exchange_rows,
           "Messages: commands and their answers."),
    GROUPS(profile, "refusals", refusals, refusals_count, refusal_rows,
           "Messages: answers that refuse, tried before the pattern."),
    GROUP(profile, "errors", errors, error_rows, "Messages: an error queue or register."),
    GROUP(profile, "registers", registers, register_rows, "Modbus: what holds for all of them."),
    GROUPS(profile, "writes", writes, writes_count, write_rows, "Modbus: what can be done."),
    GROUP(profile, "identify", identify, identify_rows, "Who it is."),
    GROUP(profile, "laser", laser, laser_rows, "The role of a laser."),
    GROUP(profile, "detector", detector, detector_rows, "The role of a detector or monitor."),
    GROUP(profile, "axis", axis, axis_rows, "The role of a motor axis."),
    GROUP(profile, "selector", selector, selector_rows,
          "The role of what has named positions: shutter, filter wheel, chopper."),
    GROUP(profile, "inputs", inputs, input_rows, "The role of switches and sensors."),
    GROUP(profile, "simulate", simulate, simulate_rows, "How the simulated instrument behaves."),
    GROUPS(profile, "golden", golden, golden_count, golden_rows,
           "Bytes that a manual, public source or recording shows, and what they mean."),
    {0}};
