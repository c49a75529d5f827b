// SPDX-License-Identifier: MIT
// The bench: axes in user units (degrees, millimetres), laser, detector, monitor and further
// devices (daemon/instrument_devices.h), opened from a bench configuration and kept open. Each
// part's link state, last values and errors are remembered for `gonio status`. Thread: instrument;
// others see copies of struct instrument_snapshot.
//
// A part that is not there when the bench is opened, or that goes away, is "lost": calls to it fail
// with GON_E_GONE or GON_E_LINK and its name in front ("axis theta_r: ..."), and instrument_connect
// brings it back. Errors that name a device name it once. The drivers get no cancel token: whatever
// ends a run must still reach the laser and the axes; their own time limits bound each call.
//
// What comes back is the same device by the serial number it gave before (drivers/identity.h), or
// stays lost and is not used: calls fail with the reason. An OFF that another laser confirmed says
// nothing of the light of the one before.
//
// Every wait goes through instrument_wait, in slices of at most 100 ms that renew the laser's lease
// (safety_tick) and call the watcher. Drivers are given a clock whose sleeping does the same.
#pragma once
#include "base/cancel.h"
#include "base/clk.h"
#include "base/err.h"
#include "campaign/bench.h"
#include "daemon/arm.h"
#include "daemon/safety.h"
#include "daemon/suspend.h"
#include "drivers/axis.h"
#include "drivers/detector.h"
#include "drivers/laser.h"
#include "drivers/link_stats.h"

#include <stdbool.h>
#include <stdint.h>

struct guard_host;
struct inputs;
struct instrument;
struct selector;

// The first parts are the axes, in the order of the bench file: part i is its axes[i]; the last are
// its devices: PART_DEVICES + i is its devices[i].
enum instrument_part {
    INSTRUMENT_AXES = BENCH_AXES,
    PART_LASER = INSTRUMENT_AXES,
    PART_DETECTOR,
    PART_MONITOR, // a detector of its own
    PART_DEVICES,
    PART_COUNT = PART_DEVICES + BENCH_DEVICES
};

enum part_link { PART_ABSENT, PART_OK, PART_LOST };

struct part_state {
    const char *name;     // the axis's, the device's, "laser", "detector", "monitor"; "": absent
    enum part_link link;  // PART_ABSENT: the bench has none
    const char *driver;   // as the bench file names it; "": absent
    const char *address;  // of its link; "" when made from ready objects
    char identity[96];    // what it said it is
    char problem[240];    // why it is lost; "" when it is not
    bool refused;         // it answered and is not to be used, as problem says: another device, by
                          // its serial number or kind; until the right one is there
    uint64_t errors;      // failed calls since the start
    uint64_t returns;     // times it came back
    char last_error[240]; // "" when there was none since the start
    int64_t last_error_ns;
    struct link_stats stats; // of its link, which others may share; zero without one
};

enum { INSTRUMENT_VALUES = 16, INSTRUMENT_WORD = 32 };

struct instrument_value {
    char name[INSTRUMENT_WORD], unit[12];
    double number; // NAN: not known
};

// A selector or inputs.
struct device_state {
    enum bench_use use;
    char position[INSTRUMENT_WORD]; // where it was seen last; "": at none, not known, or inputs
    const char *wanted;             // where it stands while measuring; "": inputs
    struct instrument_value value[INSTRUMENT_VALUES]; // of inputs, as of the last look
    int values;
};

// Everything that is known of the bench, as of the last time each part was asked.
struct instrument_snapshot {
    int64_t t_ns; // clock time of the copy
    struct part_state part[PART_COUNT];
    struct {
        const char *unit;        // "deg", "mm"
        double position, target; // user units; NAN: not known
        double dial;             // the motor's own scale, campaign/bench.h; NAN: not known
        double raw_steps;        // of the motor, from the encoder; NAN: not known
        bool moving, homed, alarm;
        int alarm_code;
    } axis[INSTRUMENT_AXES];
    struct laser_status laser; // as last read
    bool emission;             // commanded on and not read back off: what is to be assumed
    bool off_unconfirmed;      // LASER MAY BE ON
    int range;                 // of the detector; -1: not known
    char detector_unit[12];    // of full_scale_v and signal_v: "V", "A", "W"
    double full_scale_v;
    double signal_v, monitor_v; // last sample; NAN: none
    int monitor_range;          // of a monitor of its own; -1: not known
    char monitor_unit[12];
    double monitor_full_scale; // in its unit; NAN: not known
    struct device_state device[BENCH_DEVICES];
    double time_constant_s; // as the device has it
    struct suspender_state suspender[BENCH_SUSPENDERS];
};

// Objects that exist already, for tests and simulations; taken over, each may be NULL but not laser
// and detector. Reopening an axis is then its identify.
struct instrument_parts {
    struct axis *axis[INSTRUMENT_AXES];
    struct laser *laser;
    struct detector *detector, *monitor;
    struct selector *selector[BENCH_DEVICES];
    struct inputs *inputs[BENCH_DEVICES];
};

// Opens what is there; what is not is lost, which is no error. GON_E_INPUT: a link's text is wrong;
// GON_E_SYSTEM. The bench is borrowed for the object's life. guard: who has the guard process that
// is to hold the laser's port; NULL: this process opens it itself, which is for tests.
int instrument_open(const struct bench_config *bench, const struct guard_host *guard,
                    struct clk *clk,
                    struct instrument **ret_instrument, struct gon_error *err);
int instrument_new(const struct bench_config *bench, const struct instrument_parts *parts,
                   struct clk *clk, struct instrument **ret_instrument, struct gon_error *err);
// Laser off and axes stopped first. False when OFF was not read back, also when the laser was never
// reached: what it does then nobody knows.
bool instrument_free(struct instrument *in);

const struct bench_config *instrument_bench(const struct instrument *in);
const struct kinematics *instrument_kinematics(const struct instrument *in);
void instrument_snapshot(const struct instrument *in, struct instrument_snapshot *ret_snapshot);
// Read back off by a laser that can be reached; nothing else may be called off. Any thread.
bool instrument_is_dark(const struct instrument_snapshot *s);
// Called between slices of every wait, on the instrument thread: at most 100 ms apart while the
// engine waits. It must be quick and must not call back into the instrument, except
// instrument_snapshot.
void instrument_watch(struct instrument *in, void (*watcher)(void *ctx), void *ctx);
// What is heeded (daemon/instrument_suspend.h) ends it with GON_E_CANCELED, too.
int instrument_wait(struct instrument *in, int64_t until_ns, const struct cancel *cancel);
// For waits elsewhere on the instrument thread (the store's acknowledgement): what a slice does. At
// least every 100 ms.
void instrument_breathe(struct instrument *in);
int64_t instrument_now_ns(const struct instrument *in);
int64_t instrument_utc_ns(const struct instrument *in);

// For an instrument that runs nothing, about once a second: asks every part that is there how it is
// and tries once to bring back one that is lost (paced, 0.1 to 5 s). Repeats an unconfirmed off.
// Returns the number of parts lost. instrument_reconnect is all of it but the asking.
int instrument_tend(struct instrument *in);
int instrument_reconnect(struct instrument *in);

// A lost part, or PART_COUNT. One try to bring it back: reopen, identify; a laser is switched off,
// an axis stopped, a detector set up as configured; a selector stays where it is. 0 when it is
// there. GON_E_DEVICE: another device answers in its place.
enum instrument_part instrument_lost(const struct instrument *in);
int instrument_connect(struct instrument *in, enum instrument_part part, struct gon_error *err);
bool instrument_has(const struct instrument *in, enum instrument_part part);

// --- axes, in user units; part < INSTRUMENT_AXES -------------------------------------------------
#define INSTRUMENT_FRESH_MS 500.0

struct axis_place {
    double position, target; // user units, from the encoder and of the last command
    double dial, raw_steps;  // the same position, as in the snapshot
    bool moving, in_position, ready, homed, alarm;
    int alarm_code;
    const char *alarm_text;
};

const struct bench_axis *instrument_axis(const struct instrument *in, enum instrument_part part);
int instrument_place(struct instrument *in, enum instrument_part part, struct axis_place *ret_place,
                     struct gon_error *err);
// The same from memory, when the axis was seen standing at its target at most INSTRUMENT_FRESH_MS
// ago and told nothing since; otherwise asks. Each question costs some ms on a serial line.
int instrument_place_recent(struct instrument *in, enum instrument_part part,
                            struct axis_place *ret_place, struct gon_error *err);
// Checks travel limits (GON_E_INPUT), then commands once. GON_E_LINK: it may have been carried out.
int instrument_go(struct instrument *in, enum instrument_part part, double position,
                  struct gon_error *err);
int instrument_go_home(struct instrument *in, enum instrument_part part, struct gon_error *err);
int instrument_halt(struct instrument *in, enum instrument_part part, struct gon_error *err);
// Whether the last moves took up the play so that the load is where the encoder says: it went the
// way of its approach by at least the backlash since it last went the other way, was stopped or was
// homed. Always true without backlash.
bool instrument_engaged(const struct instrument *in, enum instrument_part part);
// The position nearest to the one asked that is a whole number of steps.
double instrument_rounded(const struct instrument *in, enum instrument_part part, double position);

// --- laser: as safety.h, with the part's link kept --------------------------------------------
int instrument_laser(struct instrument *in, struct laser_status *ret_status, struct gon_error *err);
// One short question: whether it says that light comes out.
int instrument_light(struct instrument *in, bool *ret_emission, struct gon_error *err);
int instrument_power(struct instrument *in, double power_w, struct gon_error *err);
int instrument_emission_on(struct instrument *in, struct gon_error *err);
int instrument_emission_off(struct instrument *in, struct gon_error *err);
void instrument_permit(struct instrument *in, bool running);
// Who armed the laser. The instrument ends it when it runs out and when the alarm rises; whoever
// else changes it does so by its rules, on this thread.
struct arm *instrument_arm(struct instrument *in);
// Once this stop is asked for, off goes out in the next slice of whatever is waited for, also in
// the middle of another device's call. Borrowed until the next call; NULL: none.
void instrument_obey(struct instrument *in, const struct cancel *stop);
// What the laser's guard did without being asked, or that the arm ended in the light, since the
// permission was given: 0, or why. The laser is off then, or goes off, or its guard is gone.
int instrument_alarm(const struct instrument *in, struct gon_error *err);
enum safety_light instrument_light_left(const struct instrument *in); // what may be said of it
const struct safety *instrument_safety(const struct instrument *in);

// --- detector ---------------------------------------------------------------------------------
int instrument_ranges(const struct instrument *in);
double instrument_full_scale_v(const struct instrument *in, int range);
int instrument_range(const struct instrument *in); // -1: not known
// The configured time constant and slope, written and read back; the range is not known afterwards.
int instrument_set_up(struct instrument *in, struct gon_error *err);
int instrument_set_range(struct instrument *in, int range, struct gon_error *err);
// With a monitor of its own, that one is read directly after the detector: monitor_v is its value.
int instrument_sample(struct instrument *in, struct detector_sample *ret_sample,
                      struct gon_error *err);
int instrument_clear(struct instrument *in, struct gon_error *err); // as detector.h
int instrument_condition(struct instrument *in, unsigned *ret_flags, struct gon_error *err);
double instrument_time_constant_s(const struct instrument *in); // as the device has it
