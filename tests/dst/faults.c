// SPDX-License-Identifier: MIT
#include "tests/dst/faults.h"

#include "tests/dst/trial.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

const char *const reaction_names[] = {"goes on", "returns", "repeats", "homes",
                                      "pauses",  "warns",   "stops"};

static struct line *bus(struct trial *t)
{
    return &t->rig.line[RIG_BUS];
}

// The laser's or the detector's.
static struct line *text_line(struct trial *t, int variant)
{
    return &t->rig.line[variant & 1 ? RIG_LASER : RIG_DETECTOR];
}

static struct rig_gate *gate(struct trial *t, int variant)
{
    return &t->rig.gate[variant % RIG_AXES];
}

static enum world_axis axis_of(int variant)
{
    return (enum world_axis)(variant % RIG_AXES);
}

static struct sim_laser *laser(struct trial *t)
{
    world_see(&t->rig.bench.world, os.now_ns);
    return &t->rig.bench.world.laser;
}

// What comes next changes what there is to be measured.
static void change_world(struct trial *t)
{
    world_see(&t->rig.bench.world, os.now_ns);
    t->watch.world_ns = os.now_ns;
}

static int64_t late_ns(int variant)
{
    return OS_MS(20 + variant % 60 * 50);
}

// --- wires ---------------------------------------------------------------------------------------

static void lose(struct trial *t, int v)
{
    line_disturb(bus(t), v % 5 ? LINE_LOST : LINE_DEAF, 1 + v % 3);
}

static void lose_many(struct trial *t, int v)
{
    (void)v;
    line_disturb(bus(t), LINE_LOST, 12);
}

static void flip(struct trial *t, int v)
{
    line_disturb(bus(t), LINE_FLIPPED, 1 + v % 2);
}

static void wrong_header(struct trial *t, int v)
{
    line_disturb(bus(t), v % 2 ? LINE_WRONG_UNIT : LINE_WRONG_FUNCTION, 1);
}

static void late(struct trial *t, int v)
{
    bus(t)->late_ns = late_ns(v);
    line_disturb(bus(t), v % 3 ? LINE_LATE : LINE_DOUBLED, 1);
}

static void mangle(struct line *l, int v)
{
    static const enum line_fault ways[] = {LINE_CUT, LINE_SPLIT, LINE_BEFORE, LINE_AFTER,
                                           LINE_MERGED};
    line_disturb(l, ways[v % 5], 1);
}

static void mangle_bus(struct trial *t, int v)
{
    mangle(bus(t), v);
}

static void break_bus(struct trial *t, int v)
{
    line_pull(bus(t), v % 2 ? ECONNRESET : 0, false);
}

static void hole(struct trial *t, int v)
{
    (void)v;
    bus(t)->hole = true;
}

static void fill(struct trial *t)
{
    line_plug(bus(t));
}

static void stale_number(struct trial *t, int v)
{
    (void)v;
    line_disturb(bus(t), LINE_STALE_NUMBER, 1);
}

static void wrong_echo(struct trial *t, int v)
{
    (void)v;
    line_disturb(bus(t), LINE_WRONG_ECHO, 1);
}

static void text_noise(struct trial *t, int v)
{
    line_disturb(text_line(t, v), v & 2 ? LINE_BEFORE : LINE_AFTER, 1);
}

static void text_cut(struct trial *t, int v)
{
    line_disturb(text_line(t, v), v & 2 ? LINE_CUT : LINE_LOST, 1);
}

static void text_late(struct trial *t, int v)
{
    text_line(t, v)->late_ns = OS_MS(20 + v % 60 * 5);
    line_disturb(text_line(t, v), LINE_LATE, 1);
}

static void text_very_late(struct trial *t, int v)
{
    text_line(t, v)->late_ns = OS_MS(500 + v % 50 * 50);
    line_disturb(text_line(t, v), LINE_LATE, 1);
}

static void text_doubled(struct trial *t, int v)
{
    text_line(t, v)->late_ns = OS_MS(20 + v % 60 * 5);
    line_disturb(text_line(t, v), LINE_DOUBLED, 1);
}

static void text_split(struct trial *t, int v)
{
    line_disturb(text_line(t, v), v & 2 ? LINE_SPLIT : LINE_MERGED, 1);
}

static void endless(struct trial *t, int v)
{
    line_disturb(text_line(t, v), LINE_ENDLESS, 1);
}

static void echo_on(struct trial *t, int v)
{
    (void)v;
    t->rig.bench.laser.echo = true;
}

static void echo_off(struct trial *t)
{
    t->rig.bench.laser.echo = false;
}

static void comma(struct trial *t, int v)
{
    (void)v;
    line_disturb(&t->rig.line[RIG_DETECTOR], LINE_COMMA, 1);
}

static void no_number(struct trial *t, int v)
{
    static const char *const answers[] = {"nan",    "inf",     "-INF", "OVLD",
                                          "9.9E37", "9.91E37", "1.2 V"};
    t->rig.line[RIG_DETECTOR].number = answers[v % 7];
    line_disturb(&t->rig.line[RIG_DETECTOR], LINE_NO_NUMBER, 1);
}

static void unplug(struct trial *t, int v)
{
    line_pull(&t->rig.line[v % RIG_LINES], v % 2 ? EIO : ENODEV, true);
}

static void plug(struct trial *t)
{
    for (int i = 0; i < RIG_LINES; i++)
        if (t->rig.line[i].away)
            line_plug(&t->rig.line[i]);
}

// --- axes ----------------------------------------------------------------------------------------

static void refuse(struct trial *t, int v, int code, int times)
{
    gate(t, v)->exception = code;
    gate(t, v)->exceptions = times;
}

static void exception_123(struct trial *t, int v)
{
    refuse(t, v, 1 + v % 3, 1);
}

static void exception_4(struct trial *t, int v)
{
    refuse(t, v, 4, 1);
}

static void exception_busy(struct trial *t, int v)
{
    refuse(t, v, 5 + v % 2, 1 + v % 4);
}

static void restart(struct trial *t, int v)
{
    t->watch.forced_ns = os.now_ns;
    bench_power_cycle(&t->rig.bench, axis_of(v), os.now_ns);
}

static void alarm(struct trial *t, int v)
{
    static const int codes[] = {SIM_AZ_DEVIATION, SIM_AZ_OVERLOAD};
    t->watch.forced_ns = os.now_ns;
    bench_raise(&t->rig.bench, axis_of(v), codes[v / 3 % 2], os.now_ns);
}

static void limit(struct trial *t, int v)
{
    t->watch.forced_ns = os.now_ns;
    bench_raise(&t->rig.bench, axis_of(v), SIM_AZ_OVERTRAVEL, os.now_ns);
}

// By hand, at the controller. A motor that was without current is not where it was.
static void clear_alarms(struct trial *t)
{
    for (int i = 0; i < RIG_AXES; i++) {
        t->rig.bench.az[i].alarm = 0;
        t->rig.bench.leadshine[i].alarm = 0;
    }
}

static void freeze(struct trial *t, int v)
{
    struct rig_gate *g = gate(t, v);
    const uint32_t at = (uint32_t)bench_motor(&t->rig.bench, g->axis, os.now_ns).steps;
    g->frozen_at[0] = (uint16_t)(at >> 16);
    g->frozen_at[1] = (uint16_t)at;
    g->frozen = true;
}

static void thaw(struct trial *t)
{
    for (int i = 0; i < RIG_AXES; i++)
        t->rig.gate[i].frozen = t->rig.gate[i].never_done = false;
}

static void miss(struct trial *t, int v)
{
    gate(t, v)->misses = 1 + v / 3 % 2;
    gate(t, v)->miss_steps = v % 2 ? 40 : -25;
}

static void miss_always(struct trial *t, int v)
{
    gate(t, v)->misses = 1000000;
    gate(t, v)->miss_steps = 40;
}

static void hit(struct trial *t)
{
    for (int i = 0; i < RIG_AXES; i++)
        t->rig.gate[i].misses = 0;
}

static void never_done(struct trial *t, int v)
{
    gate(t, v)->never_done = true;
}

static void slip(struct trial *t, int v)
{
    (void)v;
    t->rig.bench.az[1].origin += 0.05;
    t->rig.bench.leadshine[1].origin += 0.05;
}

static void stray(struct trial *t, int v)
{
    struct motion *m = &t->rig.bench.world.axis[v % 2];
    if (t->rig.gate[v % 2].frozen) // nobody could tell
        return;
    t->watch.forced_ns = os.now_ns;
    world_see(&t->rig.bench.world, os.now_ns);
    const double at = motion_at(m, os.now_ns).motor;
    motion_go(m, at > 80 ? at - 1.5 : at + 1.5, 60, 600, 600, os.now_ns);
}

// --- laser ---------------------------------------------------------------------------------------

static void open_interlock(struct trial *t, int v)
{
    (void)v;
    sim_laser_set_interlock(laser(t), false);
}

static void turn_key(struct trial *t)
{
    struct sim_laser *l = laser(t);
    sim_laser_set_interlock(l, true);
    sim_laser_set_key(l, false);
    sim_laser_set_key(l, true);
}

static void never_warm(struct trial *t, int v)
{
    struct sim_laser *l = laser(t);
    (void)v;
    l->temperatures_due_ns = os.now_ns + OS_S(1e6);
    if (rig_emits(&t->rig)) {
        l->state = SIM_LASER_TEMPERATURES;
        l->emission_since_ns = os.now_ns;
    }
}

static void warm(struct trial *t)
{
    laser(t)->temperatures_due_ns = os.now_ns;
}

static void weaken(struct trial *t, int v)
{
    change_world(t);
    laser(t)->setpoint_w *= v % 2 ? 0.9 : 0.97;
}

static void laser_fault(struct trial *t, int v)
{
    struct sim_laser *l = laser(t);
    l->fault = v % 2 ? 1 : 4;
    l->state = SIM_LASER_FAULT;
    l->emission_since_ns = os.now_ns;
}

static void go_out(struct trial *t, int v)
{
    (void)v;
    sim_laser_off(laser(t));
}

// It is noticed when somebody wants it off.
static void ignore_off(struct trial *t, int v)
{
    (void)v;
    laser(t)->ignores_off = true;
    t->wants_pause = true;
}

static void obey_off(struct trial *t)
{
    laser(t)->ignores_off = false;
    t->watch.laser_hit_ns = os.now_ns;
}

static void light_by_itself(struct trial *t, int v)
{
    (void)v;
    t->watch.forced_ns = os.now_ns;
    sim_laser_start(laser(t), true);
}

// --- detector ------------------------------------------------------------------------------------

static void saturate(struct trial *t, int v)
{
    (void)v;
    change_world(t);
    t->rig.bench.world.saturate = true;
}

static void unsaturate(struct trial *t)
{
    change_world(t);
    t->rig.bench.world.saturate = false;
}

static void lights_on(struct trial *t, int v)
{
    (void)v;
    change_world(t);
    t->rig.bench.world.spec.offset_v = 5e-6;
}

static void lights_off(struct trial *t)
{
    change_world(t);
    t->rig.bench.world.spec.offset_v = 2e-7;
}

static void stick(struct trial *t, int v)
{
    (void)v;
    t->rig.line[RIG_DETECTOR].stuck = true;
}

static void unstick(struct trial *t)
{
    t->rig.line[RIG_DETECTOR].stuck = false;
}

static void unlock(struct trial *t, int v)
{
    (void)v;
    t->rig.unlocked = true;
    rig_step(&t->rig);
}

static void lock(struct trial *t)
{
    t->rig.unlocked = false;
}

static void tell_detector(struct trial *t, const char *command)
{
    struct sim_sr830_port *p = &t->rig.bench.detector_port[!t->rig.spec.tcp[RIG_DETECTOR]];
    port_feed(&p->port, (const uint8_t *)command, strlen(command), os.now_ns);
    p->port.count = 0;
}

static void turn_knobs(struct trial *t, int v)
{
    tell_detector(t, v % 2 ? "SENS 20\r" : "SENS 12\r");
}

static void detector_restarts(struct trial *t, int v)
{
    (void)v;
    tell_detector(t, "*RST\r");
    t->rig.bench.detector.event |= 1 << 7;
    t->rig.bench.detector.setting[6] = 1; // OUTX
}

// --- host ----------------------------------------------------------------------------------------

static void step_clock(struct trial *t, int v)
{
    (void)t;
    os.utc_ns += OS_S(v % 2 ? 3600 : -3600) + OS_S(v % 97);
}

static void suspend(struct trial *t, int v)
{
    os_suspend(OS_S(2 + v % 600));
    t->watch.breath_ns = t->watch.laser_hit_ns = os.now_ns; // nobody could do anything
}

static void fill_disk(struct trial *t, int v)
{
    (void)t, (void)v;
    disk.full = true;
}

static void break_disk(struct trial *t, int v)
{
    (void)t;
    *(v % 3 == 0 ? &disk.broken_write : v % 3 == 1 ? &disk.broken_sync : &disk.broken_read) = true;
}

static void mend_disk(struct trial *t)
{
    (void)t;
    disk.full = disk.broken_write = disk.broken_sync = disk.broken_read = false;
    disk.locked_until_ns = 0;
}

static void lock_file(struct trial *t, int v)
{
    (void)t;
    disk.locked_until_ns = os.now_ns + OS_S(1 + v % 40);
}

static void stall(struct trial *t, int v)
{
    (void)t;
    disk.stall_ns = OS_S(v % 3 ? 12 + v % 30 : 4);
}

static void move_file(struct trial *t, int v)
{
    char other[sizeof t->path + 8];
    (void)v;
    snprintf(other, sizeof other, "%s.moved", t->path);
    rename(t->path, other);
}

static void put_back(struct trial *t)
{
    char other[sizeof t->path + 8];
    snprintf(other, sizeof other, "%s.moved", t->path);
    rename(other, t->path);
}

static void pause_by_hand(struct trial *t, int v)
{
    (void)v;
    t->wants_pause = true;
}

static void stop_by_hand(struct trial *t, int v)
{
    (void)v;
    watch_stop(&t->watch);
    cancel_request(t->cancel);
}

// --- the table -----------------------------------------------------------------------------------

const struct fault faults[] = {
    {"M1", "no answer", REACT_GOES_ON, 0, RIG_BUS, lose, NULL, 0, NULL, NULL, false},
    {"M1", "no answers at all for a while", REACT_RETURNS, 0, RIG_BUS, lose_many, NULL, 0,
     "not answer", NULL, false},
    {"M2", "a bit is wrong", REACT_GOES_ON, NEEDS_SERIAL, RIG_BUS, flip, NULL, 0, NULL, NULL,
     false},
    {"M3", "exception 1, 2, 3", REACT_PAUSES, 0, RIG_BUS, exception_123, NULL, 0, "exception", NULL,
     false},
    {"M4", "exception 4", REACT_HOMES, 0, RIG_BUS, exception_4, NULL, 0, "exception",
     "pauses for the operator, and goes on without homing", false},
    {"M5", "exception 5, 6", REACT_GOES_ON, 0, RIG_BUS, exception_busy, NULL, 0, NULL, NULL, false},
    {"M6", "wrong unit or function", REACT_GOES_ON, 0, RIG_BUS, wrong_header, NULL, 0, NULL, NULL,
     false},
    {"M7", "late or doubled answer", REACT_GOES_ON, 0, RIG_BUS, late, NULL, 0, NULL, NULL, false},
    {"M8", "cut, split, merged, garbage", REACT_GOES_ON, 0, RIG_BUS, mangle_bus, NULL, 0, NULL,
     NULL, false},
    {"M9", "connection ended or reset", REACT_RETURNS, NEEDS_TCP, RIG_BUS, break_bus, NULL, 0, NULL,
     NULL, false},
    {"M10", "connection half open", REACT_RETURNS, NEEDS_TCP, RIG_BUS, hole, fill, 12, NULL, NULL,
     false},
    {"M11", "stale transaction number", REACT_GOES_ON, NEEDS_TCP, RIG_BUS, stale_number, NULL, 0,
     NULL, NULL, false},
    {"M12", "controller restarts", REACT_HOMES, 0, RIG_BUS, restart, NULL, 0, NULL, NULL, false},
    {"M13", "following error", REACT_PAUSES, 0, RIG_BUS, alarm, clear_alarms, 0, "alarm", NULL,
     false},
    {"M13", "encoder stands still", REACT_PAUSES, 0, RIG_BUS, freeze, thaw, 0, NULL, NULL, false},
    {"M14", "limit switch", REACT_PAUSES, 0, RIG_BUS, limit, clear_alarms, 0, "alarm", NULL, false},
    {"M15", "misses its target", REACT_GOES_ON, NEEDS_AZ, RIG_BUS, miss, NULL, 0, NULL, NULL,
     false},
    {"M15", "always misses it", REACT_PAUSES, NEEDS_AZ, RIG_BUS, miss_always, hit, 0, "instead of",
     NULL, false},
    {"M16", "slips by 0.05 deg", REACT_HOMES, 0, RIG_BUS, slip, NULL, 0, NULL,
     "stores values of another direction: no fiducial is looked at again", true},
    {"M17", "never done", REACT_PAUSES, NEEDS_AZ, RIG_BUS, never_done, thaw, 0, NULL, NULL, false},
    {"M18", "moves by itself", REACT_PAUSES, 0, RIG_BUS, stray, NULL, 0, "by itself",
     "goes there again at the next move, and says nothing", false},
    {"M19", "echo of a write differs", REACT_GOES_ON, 0, RIG_BUS, wrong_echo, NULL, 0, NULL, NULL,
     false},
    {"S1", "garbage", REACT_GOES_ON, 0, RIG_DETECTOR, text_noise, NULL, 0, NULL, NULL, false},
    {"S2", "cut or lost answer", REACT_GOES_ON, 0, RIG_DETECTOR, text_cut, NULL, 0, NULL, NULL,
     false},
    {"S3", "echo on", REACT_PAUSES, NEEDS_LIGHT, RIG_LASER, echo_on, echo_off, 0, "echo", NULL,
     false},
    {"S5", "unplugged for 3 s", REACT_RETURNS, 0, RIG_BUS, unplug, plug, 3, NULL, NULL, false},
    {"S6", "decimal comma", REACT_GOES_ON, 0, RIG_DETECTOR, comma, NULL, 0, NULL, NULL, false},
    {"S7", "answer that is no number", REACT_GOES_ON, 0, RIG_DETECTOR, no_number, NULL, 0, NULL,
     NULL, false},
    {"S8", "late answer", REACT_GOES_ON, 0, RIG_DETECTOR, text_late, NULL, 0, NULL, NULL,
     false},
    {"S8", "very late answer", REACT_GOES_ON, 0, RIG_DETECTOR, text_very_late, NULL, 0, NULL, NULL,
     false},
    {"S8", "doubled answer", REACT_GOES_ON, 0, RIG_DETECTOR, text_doubled, NULL, 0, NULL,
     "goes on, but pauses where it is taken for the read-back of a setting", false},
    {"S8", "split or merged answers", REACT_GOES_ON, 0, RIG_DETECTOR, text_split, NULL, 0, NULL,
     NULL, false},
    {"S10", "line without an end", REACT_GOES_ON, 0, RIG_DETECTOR, endless, NULL, 0, NULL, NULL,
     false},
    {"L1", "interlock opens", REACT_PAUSES, NEEDS_LIGHT, RIG_LASER, open_interlock, turn_key, 0,
     "laser", NULL, false},
    {"L2", "never comes on", REACT_PAUSES, NEEDS_LIGHT, RIG_LASER, never_warm, warm, 0, "laser",
     NULL, false},
    {"L2", "goes off by itself", REACT_PAUSES, NEEDS_LIGHT, RIG_LASER, go_out, NULL, 0, "laser",
     NULL, false},
    {"L3", "power drifts by 3 to 10 %", REACT_REPEATS, NEEDS_LIGHT, RIG_LASER, weaken, NULL, 0,
     NULL, "goes on: the monitor corrects it, and nothing is flagged", false},
    {"L4", "fault", REACT_PAUSES, NEEDS_LIGHT, RIG_LASER, laser_fault, turn_key, 0, "laser", NULL,
     false},
    {"L5", "ignores OFF", REACT_WARNS, NEEDS_LIGHT, RIG_LASER, ignore_off, obey_off, 15,
     "LASER MAY BE ON", NULL, false},
    {"L6", "light by itself", REACT_WARNS, 0, RIG_LASER, light_by_itself, NULL, 0, NULL,
     "switches it off again within a second, and tells nobody", false},
    {"L8", "reference lost", REACT_REPEATS, 0, RIG_DETECTOR, unlock, lock, 0.5, NULL, NULL, false},
    {"L8", "reference lost for long", REACT_PAUSES, 0, RIG_DETECTOR, unlock, lock, 0, "reference",
     NULL, false},
    {"D1", "saturated for a moment", REACT_REPEATS, 0, RIG_DETECTOR, saturate, unsaturate, 0.03,
     NULL, NULL, false},
    {"D1", "saturated", REACT_PAUSES, 0, RIG_DETECTOR, saturate, unsaturate, 0, "saturated", NULL,
     false},
    {"D3", "dark changes", REACT_PAUSES, 0, RIG_DETECTOR, lights_on, lights_off, 30, NULL,
     "goes on: the dark is looked at before and after only", false},
    {"D4", "stuck value", REACT_PAUSES, 0, RIG_DETECTOR, stick, unstick, 30, NULL,
     "stores the same value again and again", true},
    {"D5", "range changed at the panel", REACT_REPEATS, 0, RIG_DETECTOR, turn_knobs, NULL, 0, NULL,
     NULL, false},
    {"D5", "detector restarts", REACT_GOES_ON, 0, RIG_DETECTOR, detector_restarts, NULL, 0, NULL,
     NULL, false},
    {"H1", "UTC is set", REACT_GOES_ON, 0, 0, step_clock, NULL, 0, NULL, NULL, false},
    {"H2", "suspended", REACT_PAUSES, 0, 0, suspend, NULL, 0, NULL,
     "goes on, with the light on all the time: nothing looks at CLOCK_BOOTTIME", false},
    {"H3", "disk full", REACT_RETURNS, 0, 0, fill_disk, mend_disk, 20, "store", NULL, false},
    {"H4", "disk broken", REACT_RETURNS, 0, 0, break_disk, mend_disk, 20, "store", NULL, false},
    {"op", "pause by the operator", REACT_PAUSES, 0, 0, pause_by_hand, NULL, 0, "operator", NULL,
     false},
    {"H7", "SIGTERM", REACT_STOPS, 0, 0, stop_by_hand, NULL, 0, NULL, NULL, false},
    {"H12", "file locked by another program", REACT_GOES_ON, 0, 0, lock_file, NULL, 0, NULL, NULL,
     false},
    {"H14", "file moved", REACT_RETURNS, 0, 0, move_file, put_back, 20, "store", NULL, false},
    {"H18", "commit stalls", REACT_GOES_ON, 0, 0, stall, NULL, 0, NULL, NULL, false},
};

int faults_count(void)
{
    return sizeof faults / sizeof faults[0];
}

const struct fault_elsewhere faults_elsewhere[] = {
    {"S4 H15 H16 H17 C1 C2", "refused before a campaign begins: unit and system tests"},
    {"S9", "no instrument of this bench has an error queue"},
    {"U1 U2 U3 U4 U5 U6", "no USB instrument on this bench: test_usbtmc_host, test_usbtmc"},
    {"L7 L9 C4", "no shutter, no filter wheel and no operator step on this bench"},
    {"D2", "every campaign has directions with hardly any light"},
    {"H5 H6 H13 C3", "of the daemon around the engine: unit and system tests"},
    {"H8 H9 H10 H11", "of the process and its guard: system tests"},
    {NULL, NULL}};

bool fault_fits(const struct fault *f, const struct trial *t)
{
    const struct rig_spec *s = &t->rig.spec;
    if ((f->needs & NEEDS_TCP && !s->tcp[f->line]) || (f->needs & NEEDS_SERIAL && s->tcp[f->line]))
        return false;
    return !(f->needs & NEEDS_AZ) || s->controller == BENCH_AZ;
}

static void mend(void *ctx, int index)
{
    struct trial *t = ctx;
    if (!t->active[index])
        return;
    os_trace("mended", '!', faults[index].id, strlen(faults[index].id));
    faults[index].mend(t);
    t->active[index] = false;
}

void fault_begin(struct trial *t, int index, int variant)
{
    const struct fault *f = &faults[index];
    os_trace("fault", '!', f->id, strlen(f->id));
    os_trace("fault", '!', f->what, strlen(f->what));
    t->injected++;
    t->last_fault = index;
    t->counts[index]++;
    f->begin(t, variant);
    watch_step(&t->watch, os.now_ns); // what was done now is not the engine's doing
    if (!f->mend || t->active[index])
        return;
    t->active[index] = true;
    t->began_ns[index] = os.now_ns;
    if (f->hold_s > 0)
        os_at(os.now_ns + OS_S(f->hold_s), mend, t, index);
}

// Who comes to a pause looks for what is wrong then, not for what happened after he had looked.
void faults_mend(struct trial *t, bool all)
{
    for (int i = 0; i < faults_count(); i++)
        if (all || (faults[i].hold_s == 0 && t->began_ns[i] < t->paused_ns))
            mend(t, i);
}
