// SPDX-License-Identifier: MIT
#include "tests/dst/faults.h"

#include "tests/dst/faults_inside.h"

#include <string.h>

const char *const reaction_names[] = {"goes on", "returns", "repeats", "homes",
                                      "pauses",  "warns",   "stops"};

// --- the table -----------------------------------------------------------------------------------

const struct fault faults[] = {
    {"M1", "no answer", REACT_GOES_ON, 0, RIG_BUS, fault_lose, NULL, 0, NULL, NULL, false},
    {"M1", "no answers at all for a while", REACT_RETURNS, 0, RIG_BUS, fault_lose_many, NULL, 0,
     "not answer", NULL, false},
    {"M2", "a bit is wrong", REACT_GOES_ON, NEEDS_SERIAL, RIG_BUS, fault_flip, NULL, 0, NULL, NULL,
     false},
    {"M3", "exception 1, 2, 3", REACT_PAUSES, 0, RIG_BUS, fault_exception_123, NULL, 0, "exception",
     NULL, false},
    {"M4", "exception 4", REACT_HOMES, 0, RIG_BUS, fault_exception_4, NULL, 0, "exception",
     "pauses for the operator, and goes on without homing", false},
    {"M5", "exception 5, 6", REACT_GOES_ON, 0, RIG_BUS, fault_exception_busy, NULL, 0, NULL, NULL,
     false},
    {"M6", "wrong unit or function", REACT_GOES_ON, 0, RIG_BUS, fault_wrong_header, NULL, 0, NULL,
     NULL, false},
    {"M7", "late or doubled answer", REACT_GOES_ON, 0, RIG_BUS, fault_late, NULL, 0, NULL, NULL,
     false},
    {"M8", "cut, split, merged, garbage", REACT_GOES_ON, 0, RIG_BUS, fault_mangle_bus, NULL, 0,
     NULL, NULL, false},
    {"M9", "connection ended or reset", REACT_RETURNS, NEEDS_TCP, RIG_BUS, fault_break_bus, NULL, 0,
     NULL, NULL, false},
    {"M10", "connection half open", REACT_RETURNS, NEEDS_TCP, RIG_BUS, fault_hole, fault_fill, 12,
     NULL, NULL, false},
    {"M11", "stale transaction number", REACT_GOES_ON, NEEDS_TCP, RIG_BUS, fault_stale_number, NULL,
     0, NULL, NULL, false},
    {"M12", "controller restarts", REACT_HOMES, 0, RIG_BUS, fault_restart, NULL, 0, NULL, NULL,
     false},
    {"M13", "following error", REACT_PAUSES, 0, RIG_BUS, fault_alarm, fault_clear_alarms, 0,
     "alarm", NULL, false},
    {"M13", "encoder stands still", REACT_PAUSES, 0, RIG_BUS, fault_freeze, fault_thaw, 0, NULL,
     NULL, false},
    {"M14", "limit switch", REACT_PAUSES, 0, RIG_BUS, fault_limit, fault_clear_alarms, 0, "alarm",
     NULL, false},
    {"M15", "misses its target", REACT_GOES_ON, NEEDS_AZ, RIG_BUS, fault_miss, NULL, 0, NULL, NULL,
     false},
    {"M15", "always misses it", REACT_PAUSES, NEEDS_AZ, RIG_BUS, fault_miss_always, fault_hit, 0,
     "instead of", NULL, false},
    {"M16", "slips by 0.05 deg", REACT_HOMES, 0, RIG_BUS, fault_slip, NULL, 0, NULL,
     "stores values of another direction: no fiducial is looked at again", true},
    {"M17", "never done", REACT_PAUSES, NEEDS_AZ, RIG_BUS, fault_never_done, fault_thaw, 0, NULL,
     NULL, false},
    {"M18", "moves by itself", REACT_PAUSES, 0, RIG_BUS, fault_stray, NULL, 0, "by itself",
     "goes there again at the next move, and says nothing", false},
    {"M19", "echo of a write differs", REACT_GOES_ON, 0, RIG_BUS, fault_wrong_echo, NULL, 0, NULL,
     NULL, false},
    {"S1", "garbage", REACT_GOES_ON, 0, RIG_DETECTOR, fault_text_noise, NULL, 0, NULL, NULL, false},
    {"S2", "cut or lost answer", REACT_GOES_ON, 0, RIG_DETECTOR, fault_text_cut, NULL, 0, NULL,
     NULL, false},
    {"S3", "echo on", REACT_PAUSES, NEEDS_LIGHT, RIG_LASER, fault_echo_on, fault_echo_off, 0,
     "echo", NULL, false},
    {"S5", "unplugged for 3 s", REACT_RETURNS, 0, RIG_BUS, fault_unplug, fault_plug, 3, NULL, NULL,
     false},
    {"S6", "decimal comma", REACT_GOES_ON, 0, RIG_DETECTOR, fault_comma, NULL, 0, NULL, NULL,
     false},
    {"S7", "answer that is no number", REACT_GOES_ON, 0, RIG_DETECTOR, fault_no_number, NULL, 0,
     NULL, NULL, false},
    {"S8", "late answer", REACT_GOES_ON, 0, RIG_DETECTOR, fault_text_late, NULL, 0, NULL, NULL,
     false},
    {"S8", "very late answer", REACT_GOES_ON, 0, RIG_DETECTOR, fault_text_very_late, NULL, 0, NULL,
     NULL, false},
    {"S8", "doubled answer", REACT_GOES_ON, 0, RIG_DETECTOR, fault_text_doubled, NULL, 0, NULL,
     NULL, false},
    {"S8", "split or merged answers", REACT_GOES_ON, 0, RIG_DETECTOR, fault_text_split, NULL, 0,
     NULL, NULL, false},
    {"S10", "line without an end", REACT_GOES_ON, 0, RIG_DETECTOR, fault_endless, NULL, 0, NULL,
     NULL, false},
    {"L1", "interlock opens", REACT_PAUSES, NEEDS_LIGHT, RIG_LASER, fault_open_interlock,
     fault_turn_key, 0, "laser", NULL, false},
    {"L2", "never comes on", REACT_PAUSES, NEEDS_LIGHT, RIG_LASER, fault_never_warm, fault_warm, 0,
     "laser", NULL, false},
    {"L2", "goes off by itself", REACT_PAUSES, NEEDS_LIGHT, RIG_LASER, fault_go_out, NULL, 0,
     "laser", NULL, false},
    {"L3", "power drifts by 3 to 10 %", REACT_REPEATS, NEEDS_LIGHT, RIG_LASER, fault_weaken, NULL,
     0, NULL, "goes on: the monitor corrects it, and nothing is flagged", false},
    {"L4", "fault", REACT_PAUSES, NEEDS_LIGHT, RIG_LASER, fault_laser_fault, fault_turn_key, 0,
     "laser", NULL, false},
    {"L5", "ignores OFF", REACT_WARNS, NEEDS_LIGHT, RIG_LASER, fault_ignore_off, fault_obey_off, 15,
     "LASER MAY BE ON", NULL, false},
    {"L6", "light by itself", REACT_WARNS, 0, RIG_LASER, fault_light_by_itself, NULL, 0, NULL,
     "switches it off again within a second, and tells nobody", false},
    {"L8", "reference lost", REACT_REPEATS, 0, RIG_DETECTOR, fault_unlock, fault_lock, 0.5, NULL,
     NULL, false},
    {"L8", "reference lost for long", REACT_PAUSES, 0, RIG_DETECTOR, fault_unlock, fault_lock, 0,
     "reference", NULL, false},
    {"D1", "saturated for a moment", REACT_REPEATS, 0, RIG_DETECTOR, fault_saturate,
     fault_unsaturate, 0.03, NULL, NULL, false},
    {"D1", "saturated", REACT_PAUSES, 0, RIG_DETECTOR, fault_saturate, fault_unsaturate, 0,
     "saturated", NULL, false},
    {"D3", "dark changes", REACT_PAUSES, 0, RIG_DETECTOR, fault_lights_on, fault_lights_off, 30,
     NULL, "goes on: the dark is looked at before and after only", false},
    {"D4", "stuck value", REACT_PAUSES, 0, RIG_DETECTOR, fault_stick, fault_unstick, 30, NULL,
     "stores the same value again and again", true},
    {"D5", "range changed at the panel", REACT_REPEATS, 0, RIG_DETECTOR, fault_turn_knobs, NULL, 0,
     NULL, NULL, false},
    {"D5", "detector restarts", REACT_GOES_ON, 0, RIG_DETECTOR, fault_detector_restarts, NULL, 0,
     NULL, NULL, false},
    {"H1", "UTC is set", REACT_GOES_ON, 0, 0, fault_step_clock, NULL, 0, NULL, NULL, false},
    {"H2", "suspended", REACT_PAUSES, 0, 0, fault_suspend, NULL, 0, NULL,
     "goes on, with the light on all the time: nothing looks at CLOCK_BOOTTIME", false},
    {"H3", "disk full", REACT_RETURNS, 0, 0, fault_fill_disk, fault_mend_disk, 20, "store", NULL,
     false},
    {"H4", "disk broken", REACT_RETURNS, 0, 0, fault_break_disk, fault_mend_disk, 2.5, "store", NULL,
     false},
    {"op", "pause by the operator", REACT_PAUSES, 0, 0, fault_pause_by_hand, NULL, 0, "operator",
     NULL, false},
    {"H7", "SIGTERM", REACT_STOPS, 0, 0, fault_stop_by_hand, NULL, 0, NULL, NULL, false},
    {"H12", "file locked by another program", REACT_GOES_ON, 0, 0, fault_lock_file, NULL, 0, NULL,
     NULL, false},
    {"H14", "file moved", REACT_RETURNS, 0, 0, fault_move_file, fault_put_back, 20, "store", NULL,
     false},
    {"H18", "commit stalls", REACT_GOES_ON, 0, 0, fault_stall, NULL, 0, NULL, NULL, false},
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
