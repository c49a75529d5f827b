// SPDX-License-Identifier: MIT
// What is done to axes and laser.
#include "tests/dst/faults_inside.h"

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

// --- axes ----------------------------------------------------------------------------------------

static void refuse(struct trial *t, int v, int code, int times)
{
    gate(t, v)->exception = code;
    gate(t, v)->exceptions = times;
}

void fault_exception_123(struct trial *t, int v)
{
    refuse(t, v, 1 + v % 3, 1);
}

void fault_exception_4(struct trial *t, int v)
{
    refuse(t, v, 4, 1);
}

void fault_exception_busy(struct trial *t, int v)
{
    refuse(t, v, 5 + v % 2, 1 + v % 4);
}

void fault_restart(struct trial *t, int v)
{
    t->watch.forced_ns = os.now_ns;
    bench_power_cycle(&t->rig.bench, axis_of(v), os.now_ns);
}

void fault_alarm(struct trial *t, int v)
{
    static const int codes[] = {SIM_AZ_DEVIATION, SIM_AZ_OVERLOAD};
    t->watch.forced_ns = os.now_ns;
    bench_raise(&t->rig.bench, axis_of(v), codes[v / 3 % 2], os.now_ns);
}

void fault_limit(struct trial *t, int v)
{
    t->watch.forced_ns = os.now_ns;
    bench_raise(&t->rig.bench, axis_of(v), SIM_AZ_OVERTRAVEL, os.now_ns);
}

// By hand, at the controller. A motor that was without current is not where it was.
void fault_clear_alarms(struct trial *t)
{
    for (int i = 0; i < RIG_AXES; i++) {
        t->rig.bench.az[i].alarm = 0;
        t->rig.bench.leadshine[i].alarm = 0;
    }
}

void fault_freeze(struct trial *t, int v)
{
    struct rig_gate *g = gate(t, v);
    const uint32_t at = (uint32_t)bench_motor(&t->rig.bench, g->axis, os.now_ns).steps;
    g->frozen_at[0] = (uint16_t)(at >> 16);
    g->frozen_at[1] = (uint16_t)at;
    g->frozen = true;
}

void fault_thaw(struct trial *t)
{
    for (int i = 0; i < RIG_AXES; i++)
        t->rig.gate[i].frozen = t->rig.gate[i].never_done = false;
}

void fault_miss(struct trial *t, int v)
{
    gate(t, v)->misses = 1 + v / 3 % 2;
    gate(t, v)->miss_steps = v % 2 ? 40 : -25;
}

void fault_miss_always(struct trial *t, int v)
{
    gate(t, v)->misses = 1000000;
    gate(t, v)->miss_steps = 40;
}

void fault_hit(struct trial *t)
{
    for (int i = 0; i < RIG_AXES; i++)
        t->rig.gate[i].misses = 0;
}

void fault_never_done(struct trial *t, int v)
{
    gate(t, v)->never_done = true;
}

void fault_slip(struct trial *t, int v)
{
    (void)v;
    t->rig.bench.az[1].origin += 0.05;
    t->rig.bench.leadshine[1].origin += 0.05;
}

void fault_stray(struct trial *t, int v)
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

void fault_open_interlock(struct trial *t, int v)
{
    (void)v;
    sim_laser_set_interlock(laser(t), false);
}

void fault_turn_key(struct trial *t)
{
    struct sim_laser *l = laser(t);
    sim_laser_set_interlock(l, true);
    sim_laser_set_key(l, false);
    sim_laser_set_key(l, true);
}

void fault_never_warm(struct trial *t, int v)
{
    struct sim_laser *l = laser(t);
    (void)v;
    l->temperatures_due_ns = os.now_ns + OS_S(1e6);
    if (rig_emits(&t->rig)) {
        l->state = SIM_LASER_TEMPERATURES;
        l->emission_since_ns = os.now_ns;
    }
}

void fault_warm(struct trial *t)
{
    laser(t)->temperatures_due_ns = os.now_ns;
}

void fault_weaken(struct trial *t, int v)
{
    change_world(t);
    laser(t)->setpoint_w *= v % 2 ? 0.9 : 0.97;
}

void fault_laser_fault(struct trial *t, int v)
{
    struct sim_laser *l = laser(t);
    l->fault = v % 2 ? 1 : 4;
    l->state = SIM_LASER_FAULT;
    l->emission_since_ns = os.now_ns;
}

void fault_go_out(struct trial *t, int v)
{
    (void)v;
    sim_laser_off(laser(t));
}

// It is noticed when somebody wants it off.
void fault_ignore_off(struct trial *t, int v)
{
    (void)v;
    laser(t)->ignores_off = true;
    t->wants_pause = true;
}

void fault_obey_off(struct trial *t)
{
    laser(t)->ignores_off = false;
    t->watch.laser_hit_ns = os.now_ns;
}

void fault_light_by_itself(struct trial *t, int v)
{
    (void)v;
    t->watch.forced_ns = os.now_ns;
    sim_laser_start(laser(t), true);
}
