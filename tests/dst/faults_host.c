// SPDX-License-Identifier: MIT
// What is done to the detector and to the host.
#include "tests/dst/faults_inside.h"

#include <stdio.h>
#include <string.h>

// What comes next changes what there is to be measured.
static void change_world(struct trial *t)
{
    world_see(&t->rig.bench.world, os.now_ns);
    t->watch.world_ns = os.now_ns;
}

// --- detector ------------------------------------------------------------------------------------

void fault_saturate(struct trial *t, int v)
{
    (void)v;
    change_world(t);
    t->rig.bench.world.saturate = true;
}

void fault_unsaturate(struct trial *t)
{
    change_world(t);
    t->rig.bench.world.saturate = false;
}

void fault_lights_on(struct trial *t, int v)
{
    (void)v;
    change_world(t);
    t->rig.bench.world.spec.offset_v = 5e-6;
}

void fault_lights_off(struct trial *t)
{
    change_world(t);
    t->rig.bench.world.spec.offset_v = 2e-7;
}

void fault_stick(struct trial *t, int v)
{
    (void)v;
    t->rig.line[RIG_DETECTOR].stuck = true;
}

void fault_unstick(struct trial *t)
{
    t->rig.line[RIG_DETECTOR].stuck = false;
}

void fault_unlock(struct trial *t, int v)
{
    (void)v;
    t->rig.unlocked = true;
    rig_step(&t->rig);
}

void fault_lock(struct trial *t)
{
    t->rig.unlocked = false;
}

static void tell_detector(struct trial *t, const char *command)
{
    struct sim_sr830_port *p = &t->rig.bench.detector_port[!t->rig.spec.tcp[RIG_DETECTOR]];
    port_feed(&p->port, (const uint8_t *)command, strlen(command), os.now_ns);
    p->port.count = 0;
}

void fault_turn_knobs(struct trial *t, int v)
{
    tell_detector(t, v % 2 ? "SENS 20\r" : "SENS 12\r");
}

void fault_detector_restarts(struct trial *t, int v)
{
    (void)v;
    tell_detector(t, "*RST\r");
    t->rig.bench.detector.event |= 1 << 7;
    t->rig.bench.detector.setting[6] = 1; // OUTX
}

// --- host ----------------------------------------------------------------------------------------

void fault_step_clock(struct trial *t, int v)
{
    (void)t;
    os.utc_ns += OS_S(v % 2 ? 3600 : -3600) + OS_S(v % 97);
}

void fault_suspend(struct trial *t, int v)
{
    os_suspend(OS_S(2 + v % 600));
    t->watch.breath_ns = t->watch.laser_hit_ns = os.now_ns; // nobody could do anything
}

void fault_fill_disk(struct trial *t, int v)
{
    (void)t, (void)v;
    disk.full = true;
}

void fault_break_disk(struct trial *t, int v)
{
    (void)t;
    *(v % 3 == 0 ? &disk.broken_write : v % 3 == 1 ? &disk.broken_sync : &disk.broken_read) = true;
}

void fault_mend_disk(struct trial *t)
{
    (void)t;
    disk.full = disk.broken_write = disk.broken_sync = disk.broken_read = false;
    disk.locked_until_ns = 0;
}

void fault_lock_file(struct trial *t, int v)
{
    (void)t;
    disk.locked_until_ns = os.now_ns + OS_S(1 + v % 40);
}

void fault_stall(struct trial *t, int v)
{
    (void)t;
    disk.stall_ns = OS_S(v % 3 ? 12 + v % 30 : 4);
}

void fault_move_file(struct trial *t, int v)
{
    char other[sizeof t->path + 8];
    (void)v;
    snprintf(other, sizeof other, "%s.moved", t->path);
    rename(t->path, other);
}

void fault_put_back(struct trial *t)
{
    char other[sizeof t->path + 8];
    snprintf(other, sizeof other, "%s.moved", t->path);
    rename(other, t->path);
}

void fault_pause_by_hand(struct trial *t, int v)
{
    (void)v;
    t->wants_pause = true;
}

void fault_stop_by_hand(struct trial *t, int v)
{
    (void)v;
    watch_stop(&t->watch);
    cancel_request(t->cancel);
}
