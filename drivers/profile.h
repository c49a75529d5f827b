// SPDX-License-Identifier: MIT
// An instrument as data: what configs/profiles/NAME.cfg says of it, as plain structs. No I/O but
// reading that file, no driver code: the drivers (session, *_profile), the simulated instrument
// (sim/), `gonio profile` and the reference page all start from here. Thread: any; a profile is
// never changed after loading and may be shared.
//
// The parts of a profile
//   values     everything the instrument can say or be told, each with type, unit and range. Named
//              values are what the other parts speak of. A value of a Modbus instrument also has
//              its register; a message instrument's are found in answers by their patterns.
//   exchanges  (message instruments) one command and its answer, as patterns (profile_text.h)
//   writes     (Modbus instruments) registers set in one transaction, or one command bit's edge
//   golden     bytes that a manual, public source or recording shows, and what they mean
//   roles      what laser, detector, axis or selector are made of: which exchanges or values are
//              asked, and conditions (profile_when.h) over the values that came
//   simulate   how the simulated instrument behaves beyond remembering what it was told
//
// "asks" name exchanges of a message instrument and values of a Modbus instrument. "send" names an
// exchange or a write. Where rows have a condition, the first that holds counts; "" always holds.
#pragma once
#include "base/cfg.h"
#include "base/err.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

enum {
    PROFILE_NAME = 32,
    PROFILE_TEXT = 160, // patterns, conditions, sentences
    PROFILE_LONG = 480,
    PROFILE_VALUES = 96,
    PROFILE_BITS = 32,
    PROFILE_WORDS = 16,
    PROFILE_LADDER = 32,
    PROFILE_EXCHANGES = 64,
    PROFILE_WRITES = 24,
    PROFILE_ITEMS = 20, // registers of one write
    PROFILE_ASKS = 16,
    PROFILE_RULES = 24,
    PROFILE_CODES = 96,
    PROFILE_GOLDEN = 48,
    PROFILE_STEPS = 24,
    PROFILE_POSITIONS = 16
};

enum profile_protocol { PROFILE_MESSAGE, PROFILE_MODBUS };
enum profile_role {
    PROFILE_LASER,
    PROFILE_DETECTOR, // also serves as monitor
    PROFILE_AXIS,
    PROFILE_SELECTOR, // named positions: shutter, filter wheel, chopper
    PROFILE_INPUTS    // only values: switches, temperatures
};

// --- values --------------------------------------------------------------------------------------

enum profile_type { PROFILE_REAL, PROFILE_INT, PROFILE_HEX, PROFILE_STRING, PROFILE_WORD };
enum profile_table {
    PROFILE_HOLDING,
    PROFILE_INPUT,
    PROFILE_COIL,
    PROFILE_DISCRETE,
    PROFILE_NO_TABLE // has no register: what only the simulated instrument knows
};
enum profile_format { // of a register, in 16-bit words
    PROFILE_U16,
    PROFILE_S16,
    PROFILE_U32,
    PROFILE_S32,
    PROFILE_F32
};
enum profile_order { PROFILE_HIGH_FIRST, PROFILE_LOW_FIRST };
enum profile_access { PROFILE_READ, PROFILE_WRITE, PROFILE_READ_WRITE };

struct profile_bit {
    char name[PROFILE_NAME]; // conditions say VALUE.NAME
    int bit;                 // 0 is the lowest
    char help[PROFILE_TEXT];
};

// number = wire * scale + offset, or scale / wire + offset when inverse. A ladder is a list of
// numbers of which the wire carries the index (counted from first). Words likewise: the wire
// carries the word, the number is its index. A whole number may have words, too: names of numbers,
// counted from ladder_first, of which the wire carries the number.
struct profile_value {
    char name[PROFILE_NAME];
    int type; // enum profile_type
    char unit[12];
    double scale, offset;
    bool inverse;
    double min, max;   // of the number; equal: any. Beyond: the answer is not believed
    double resolution; // of the wire, in the unit; 0: not known. Read-backs may differ by it
    double over[4];    // wire values that mean "beyond the range": the number is INFINITY
    int over_count;
    double invalid[4]; // wire values that are no measurement: the value stays unknown
    int invalid_count;
    double ladder[PROFILE_LADDER];
    int ladder_count, ladder_first;
    char words[PROFILE_WORDS][PROFILE_NAME];
    int words_count;
    struct profile_bit bits[PROFILE_BITS]; // of a whole number
    int bits_count;
    char valid[PROFILE_TEXT]; // condition: where it does not hold the value is unknown
    bool changes;             // never twice the same (a time stamp): then it is an old answer
    char help[PROFILE_TEXT];
    // Modbus
    int table;                 // enum profile_table
    uint32_t address;          // as the manual counts it; registers.base is subtracted
    int format;                // enum profile_format
    int word_order;            // 0: as registers.word_order; else 1 + enum profile_order
    int access;                // enum profile_access
    bool alone;                // never read in a block with its neighbours
    char shares[PROFILE_NAME]; // lies in registers of that other value, and is meant to; "": none
};

// --- message instruments -------------------------------------------------------------------------

struct profile_framing {
    char end_out[8], end_in[8];
    char echo_end[8]; // the device repeats the command, then this; "": no echo
    char ok_line[16]; // a line that follows each good answer; "": none
    bool empty;       // an empty line is an answer, too
    double gap_ms, timeout_ms, quiet_ms;
    char sync[PROFILE_NAME]; // exchange whose answer is known: gets into step again
};

enum profile_sum { PROFILE_NO_SUM, PROFILE_CRC, PROFILE_SUM, PROFILE_XOR, PROFILE_LRC };
enum profile_sum_form { PROFILE_HEX_UPPER, PROFILE_HEX_LOWER, PROFILE_RAW_HIGH, PROFILE_RAW_LOW };

// Of each command and answer: over the text without terminators, written behind it. RAW_HIGH puts
// the high byte first. LRC: two's complement of the sum of bytes (Modbus over Serial
// Line, 2.5.2.2).
struct profile_checksum {
    int kind;  // enum profile_sum
    int width; // bits: 8, 16, 32
    uint32_t polynomial, initial, xor_out;
    bool reflect_in, reflect_out;
    int form;       // enum profile_sum_form
    char before[8]; // between text and checksum ("*")
};

struct profile_exchange {
    char name[PROFILE_NAME];
    char send[PROFILE_TEXT];    // pattern; what is sent without its terminator
    char answer[PROFILE_TEXT];  // pattern; "": no answer comes
    char believe[PROFILE_TEXT]; // condition over the new values; otherwise it is asked again
    bool echoes; // values that were sent and come back must be the same, else it was refused
    char verify[PROFILE_NAME]; // after a setting: this exchange reads back what was set
    double settle_ms;          // after a setting, before it is verified
    double timeout_ms;         // 0: as framing
    bool check;                // ask for errors afterwards
    char then[PROFILE_TEXT];   // what it changes in the simulated instrument
    char help[PROFILE_TEXT];
};

enum profile_meaning { // of a refusal
    PROFILE_REFUSED,
    PROFILE_BUSY, // again, later
    PROFILE_OPEN_INTERLOCK,
    PROFILE_KEY,
    PROFILE_FAULTY,
    PROFILE_FINE // not an error
};

struct profile_refusal {
    char like[PROFILE_TEXT]; // glob over the answer, letter case does not matter
    int means;               // enum profile_meaning
};

struct profile_code {
    int code;
    char text[PROFILE_TEXT];
    int means; // enum profile_meaning
};

// An error queue or register that is asked after exchanges with check.
struct profile_errors {
    char ask[PROFILE_NAME];  // exchange; "": there is none
    char fine[PROFILE_TEXT]; // condition: nothing is wrong
    char code[PROFILE_NAME]; // value with the code
    struct profile_code codes[PROFILE_CODES];
    int codes_count;
};

// --- Modbus instruments --------------------------------------------------------------------------

struct profile_registers {
    int base; // what the manual calls the first register: 0, 1; 40001: 40001, 30001, 10001 and 1
              // are the first holding and input registers, discrete inputs and coils
    int word_order, byte_order; // enum profile_order
    int block_most;             // registers in one read, 1..125
    int gap_most;               // unwanted registers that may be read along
    bool single;                // one register is written by function 6
    double timeout_ms, quiet_ms;
};

struct profile_write {
    char name[PROFILE_NAME];
    // "speed = $speed", "type = 1", a name alone as it is known; all in one transaction
    char set[PROFILE_ITEMS][PROFILE_TEXT];
    int set_count;
    char edge[PROFILE_TEXT];    // "input.stop": set and taken back; instead of set
    char release[PROFILE_NAME]; // the write that takes it back; "": the value is written as 0
    bool readback;              // the values that were set must be read back the same
    char verify[PROFILE_TEXT];  // condition that must hold afterwards
    bool repeat;                // may be sent again when its answer was lost
    char then[PROFILE_TEXT];    // as in exchanges
    char help[PROFILE_TEXT];
};

// --- golden --------------------------------------------------------------------------------------

// Message: sent and received are the bytes without terminators. Modbus: RTU frames in hexadecimal,
// CRC included ("07 10 62 00 ...").
struct profile_golden {
    char does[PROFILE_NAME]; // exchange or write; Modbus reads: "" and asks
    char asks[PROFILE_ASKS][PROFILE_NAME];
    int asks_count;
    int unit;                // Modbus address
    char with[PROFILE_LONG]; // what is set: "setpoint_w = 0.1, ..."
    char sent[PROFILE_LONG], received[PROFILE_LONG];
    char gives[PROFILE_LONG];  // values read from it, in the same form
    char source[PROFILE_TEXT]; // manual and page, public repository and path, or "recorded ..."
};

// --- roles ---------------------------------------------------------------------------------------

struct profile_asks {
    char name[PROFILE_ASKS][PROFILE_NAME];
    int count;
};

struct profile_rule { // what follows when
    char when[PROFILE_TEXT];
    int is;                  // index of the role's list: state, flag, meaning
    char send[PROFILE_NAME]; // or: exchange or write
    char text[PROFILE_TEXT];
};

struct profile_rules {
    struct profile_rule rule[PROFILE_RULES];
    int count;
};

struct profile_identify {
    struct profile_asks asks;
    struct profile_rules refuse;  // when: not the device, or not usable; text says why
    char title[PROFILE_TEXT];     // pattern: what it is called
    char serial[PROFILE_NAME];    // value: identifies one unit after replugging; "": none
    char restarted[PROFILE_TEXT]; // condition that tells of a power cycle when seen in any answer
};

// Sent while emission is on, at most period_ms apart, and not afterwards: its lease.
struct profile_keepalive {
    char send[PROFILE_NAME]; // "": none
    double period_ms;
};

struct profile_laser {
    struct profile_asks status; // everything that states, emitting, interlock, fault and power need
    struct profile_asks once;   // asked once and after a setting (set-point)
    struct profile_asks light;  // what emitting needs, and nothing more
    char emitting[PROFILE_TEXT], interlock_closed[PROFILE_TEXT]; // conditions
    struct profile_rules states;                                 // is: enum laser_state's names
    char power[PROFILE_NAME], setpoint[PROFILE_NAME], fault[PROFILE_NAME]; // values; "": none
    char set_power[PROFILE_NAME]; // exchange or write; sends the value setpoint
    double power_most_w;
    struct profile_asks before_on; // asked before ON, besides status
    struct profile_rules may_not;  // conditions against ON: is a meaning, text
    struct profile_rules prepare;  // sent before ON, all whose condition holds
    struct profile_rules on;       // the one that is sent
    struct profile_asks after_refusal;
    struct profile_rules refusals; // why: is a meaning
    char off[4][PROFILE_TEXT]; // what goes out blind, in turn, with what ends a half-sent command
    int off_count;
    struct profile_asks off_asks;
    char is_off[PROFILE_TEXT]; // condition: no light, and none is on its way
    struct profile_code faults[PROFILE_CODES];
    int faults_count;
    struct profile_keepalive keepalive;
};

struct profile_detector {
    // From the bench: values time_constant_s, slope_db, monitor_aux, wavelength_nm are set (as far
    // as the profile has them) before setup is sent.
    struct profile_rules setup;    // sent in this order, all whose condition holds
    char full_scale[PROFILE_NAME]; // value with a ladder: the ranges
    double ranges[PROFILE_LADDER]; // where its wire carries the full scale itself; else the ladder
    int ranges_count;
    struct profile_asks read_range;
    char set_range[PROFILE_NAME];
    double range_settle_ms; // after a change of range nothing is believed so long
    double settle_s;        // of the instrument, where it has no time constant: taken for one
    // What is asked for one sample. The two are taken in turn, so that a late answer does not fit.
    struct profile_asks sample, sample_monitor; // the second with monitor_aux > 0
    char signal[PROFILE_NAME], monitor[PROFILE_NAME], reference[PROFILE_NAME]; // values
    double clipped; // of full scale and above: saturated
    struct profile_asks clear, condition;
    struct profile_rules flags; // all that hold: is saturated, unlocked, unsettled
};

struct profile_axis {
    struct profile_asks status; // values that the conditions below and position need, in this order
    char position[PROFILE_NAME], target[PROFILE_NAME], alarm_code[PROFILE_NAME];
    char moving[PROFILE_TEXT], in_position[PROFILE_TEXT], ready[PROFILE_TEXT], homed[PROFILE_TEXT],
        alarm[PROFILE_TEXT], limit[PROFILE_TEXT]; // conditions
    // move is given $position, $speed, $acceleration (steps, steps/s, steps/s2); sent once
    char move[PROFILE_NAME], stop[PROFILE_NAME], home[PROFILE_NAME], reset[PROFILE_NAME],
        enable[PROFILE_NAME], clear[PROFILE_NAME];     // clear: takes back command bits left set
    double speed_least, speed_most, acceleration_most; // steps/s, steps/s2
    char following[PROFILE_TEXT];                      // condition: a following error
    struct profile_code alarms[PROFILE_CODES];
    int alarms_count;
    char watchdog[PROFILE_NAME]; // write; "": none
    double watchdog_ms;
};

struct profile_position {
    char name[PROFILE_NAME]; // "open", "closed", "1"
    char when[PROFILE_TEXT]; // condition: it is there
    char send[PROFILE_NAME]; // what takes it there, sent only while it is not
    bool toggles;            // what is sent only changes over: never sent before the state is known
};

struct profile_selector {
    struct profile_asks status;
    struct profile_position positions[PROFILE_POSITIONS];
    int positions_count;
    char moving[PROFILE_TEXT]; // condition
    double timeout_s;
    char safe[PROFILE_NAME]; // position that is safe ("closed"); "": none
    struct profile_rules setup;
};

struct profile_inputs {
    struct profile_asks status;
    char watchdog[PROFILE_NAME]; // write that keeps a relay on; "": none
    double watchdog_ms;          // at most so far apart, or the relay drops
};

// --- the simulated instrument --------------------------------------------------------------------
// What exchanges, writes, drifts and refusals change ("then") are assignments with commas between:
//   emission = 1   mode = warming   output.moving = 0 (one bit)   target = position (as another
//   value is now)   open = not open (0 becomes 1, others 0)
// They follow the answer: a register that is cleared by reading is answered as it was.

struct profile_start { // what a value is when the power comes on
    char value[PROFILE_NAME];
    char is[PROFILE_TEXT]; // number, word or text
};

// While when holds the value goes to "to" (number or value's name), at rate a second; 0: at once.
struct profile_drift {
    char value[PROFILE_NAME], when[PROFILE_TEXT], to[PROFILE_NAME];
    double rate;
    char rate_value[PROFILE_NAME]; // or: as fast as this value says
    char then[PROFILE_TEXT];       // once it is there
};

// What it does not do, first row that fits. does: an exchange or write; "": every command that is
// not known or has a number beyond its range.
struct profile_deny {
    char does[PROFILE_NAME], when[PROFILE_TEXT];
    char answer[PROFILE_TEXT]; // pattern; "": silence. Modbus: the exception's number
    char then[PROFILE_TEXT];   // an error register's bit
};

struct profile_follow { // what is always so while something else is: flags of what is measured
    char when[PROFILE_TEXT], then[PROFILE_TEXT];
};

// In the simulated bench (sim.cfg) signal, monitor and reference of a detector and the position of
// an axis are what the world makes them, and the world has the light of a laser: laser.power, or
// its set-point, while shines holds ("": laser.emitting).
struct profile_simulate {
    struct profile_start start[PROFILE_VALUES];
    int start_count;
    struct profile_follow follows[PROFILE_STEPS];
    int follows_count;
    char shines[PROFILE_TEXT]; // condition
    struct profile_drift drift[PROFILE_STEPS];
    int drift_count;
    struct profile_deny deny[PROFILE_STEPS];
    int deny_count;
    double reply_ms;
};

struct profile {
    char name[PROFILE_NAME], title[PROFILE_TEXT], link[PROFILE_TEXT]; // link: an example
    int role, protocol;
    char source[PROFILE_LONG];
    char unverified[PROFILE_STEPS][PROFILE_TEXT];
    int unverified_count;
    struct profile_value values[PROFILE_VALUES];
    int values_count;
    struct profile_framing framing;
    struct profile_checksum checksum;
    struct profile_exchange exchanges[PROFILE_EXCHANGES];
    int exchanges_count;
    struct profile_refusal refusals[PROFILE_RULES];
    int refusals_count;
    struct profile_errors errors;
    struct profile_registers registers;
    struct profile_write writes[PROFILE_WRITES];
    int writes_count;
    struct profile_identify identify;
    struct profile_laser laser;
    struct profile_detector detector;
    struct profile_axis axis;
    struct profile_selector selector;
    struct profile_inputs inputs;
    struct profile_simulate simulate;
    struct profile_golden golden[PROFILE_GOLDEN];
    int golden_count;
};

extern const struct cfg_row profile_schema[];

// The lists that "is" and the like choose from, NULL at their end.
extern const char *const profile_roles[], *const profile_laser_states[],
                                              *const profile_flags[], *const profile_meanings[];

// Reads and checks a file, every name, pattern and condition in it too; every mistake goes to the
// sink as "file:line: ...". ret_text (may be NULL) gets the file as it was read; free it.
// GON_E_INPUT when anything is wrong. The profile is freed with free().
int profile_load(const char *path, struct cfg_sink sink, struct profile **ret_profile,
                 char **ret_text);
int profile_parse(const char *text, const char *name, struct cfg_sink sink,
                  struct profile **ret_profile);

// The file of a profile by its name: a NAME with a slash is a path, from folder (NULL: here) if it
// is relative; else NAME.cfg in folder/profiles, in the folders of GONIO_PROFILES (colons between),
// beside the program (../share/gonio/profiles). GON_E_INPUT says where it was looked for.
int profile_find(const char *name, const char *folder, char *ret_path, size_t size,
                 struct gon_error *err);

// Found and loaded; the error says the first mistake. folder may be NULL.
int profile_open(const char *name, const char *folder, struct profile **ret_profile,
                 struct gon_error *err);

int profile_value(const struct profile *p, const char *name);    // index, or -1
int profile_exchange(const struct profile *p, const char *name); // index, or -1
int profile_write(const struct profile *p, const char *name);    // index, or -1
