// SPDX-License-Identifier: MIT
#include "sim/laser.h"

#include <math.h>
#include <string.h>

#define WARM_LACK 3.3546262790251185e-4 // e^-8
#define THRESHOLD_A 0.4
#define SLOPE_W_PER_A 0.2

void sim_laser_init(struct sim_laser *l, const struct sim_laser_spec *spec, uint64_t seed,
                    int64_t t_ns)
{
    memset(l, 0, sizeof *l);
    l->spec = *spec;
    l->t_ns = t_ns;
    l->key = l->interlock_closed = l->autostart = true;
    l->setpoint_w = spec->power_w;
    l->current_a = THRESHOLD_A;
    noise_init(&l->noise, seed, 100);
    l->drift = (struct noise_drift){.rms = spec->drift_rms, .tau_s = spec->drift_tau_s};
    l->rin = (struct noise_drift){.rms = spec->rin_rms, .tau_s = spec->rin_tau_s};
    l->drift.value = l->drift.rms * noise_normal(&l->noise);
    l->emission_since_ns = t_ns;
    l->last_off_ns = l->last_on_ns = INT64_MIN;
}

bool sim_laser_emits(const struct sim_laser *l)
{
    return l->state == SIM_LASER_WARMING || l->state == SIM_LASER_COMPLETED;
}

double sim_laser_power_w(const struct sim_laser *l)
{
    if (!sim_laser_emits(l))
        return 0;
    double w = l->setpoint_w;
    if (l->constant_current)
        w = fmin(fmax(0, (l->current_a - THRESHOLD_A) * SLOPE_W_PER_A), l->spec.power_max_w);
    return w * l->warmth * (1 + l->drift.value + l->rin.value);
}

double sim_laser_current_a(const struct sim_laser *l)
{
    if (!sim_laser_emits(l))
        return 0;
    return l->constant_current ? l->current_a : THRESHOLD_A + l->setpoint_w / SLOPE_W_PER_A;
}

static void enter(struct sim_laser *l, enum sim_laser_state state)
{
    bool was = sim_laser_emits(l);
    l->state = state;
    if (was != sim_laser_emits(l))
        l->emission_since_ns = l->t_ns;
}

// Moves the continuous parts to t_ns without changing the state.
static void flow(struct sim_laser *l, int64_t t_ns)
{
    double dt_s = (double)(t_ns - l->t_ns) * 1e-9;
    if (dt_s <= 0)
        return;
    double tau_s = l->spec.warmup_s / 8;
    if (sim_laser_emits(l)) {
        l->warmth = 1 - (1 - l->warmth) * exp(-dt_s / tau_s);
        noise_drift_step(&l->rin, &l->noise, dt_s);
    } else {
        l->warmth *= exp(-dt_s / (4 * tau_s));
    }
    l->drift_due_s += dt_s;
    if (l->drift_due_s > l->drift.tau_s * 1e-5) { // jumps of 0.4 % of its rms
        noise_drift_step(&l->drift, &l->noise, l->drift_due_s);
        l->drift_due_s = 0;
    }
    l->t_ns = t_ns;
}

// When the present state ends by itself; INT64_MAX: never.
static int64_t next_change_ns(const struct sim_laser *l)
{
    if (l->state == SIM_LASER_TEMPERATURES)
        return l->temperatures_due_ns;
    if (l->state == SIM_LASER_KEY)
        return l->key && !l->needs_key_cycle ? l->t_ns : INT64_MAX;
    if (l->state != SIM_LASER_WARMING)
        return INT64_MAX;
    double lack = 1 - l->warmth;
    double left_s = lack > WARM_LACK ? log(lack / WARM_LACK) * l->spec.warmup_s / 8 : 0;
    return l->t_ns + (int64_t)(left_s * 1e9);
}

void sim_laser_step(struct sim_laser *l, int64_t t_ns)
{
    for (;;) {
        int64_t change_ns = next_change_ns(l);
        if (change_ns > t_ns)
            break;
        flow(l, change_ns);
        enter(l,
              (enum sim_laser_state)(l->state + 1)); // the states are in the order of the sequence
    }
    flow(l, t_ns);
}

enum sim_laser_refusal sim_laser_start(struct sim_laser *l, bool autostart_sequence)
{
    l->last_on_ns = l->t_ns;
    l->ons++;
    if (!autostart_sequence && l->autostart)
        return SIM_LASER_AUTOSTART;
    if (!l->interlock_closed)
        return SIM_LASER_INTERLOCK;
    if (l->fault)
        return SIM_LASER_FAULTY;
    if (!autostart_sequence && (!l->key || l->needs_key_cycle))
        return SIM_LASER_NO_KEY;
    if (l->state >= SIM_LASER_TEMPERATURES && l->state <= SIM_LASER_COMPLETED)
        return SIM_LASER_ACCEPTED;   // on its way, or there
    if (l->temperatures_due_ns == 0) // the TECs stay on from then on
        l->temperatures_due_ns = l->t_ns + (int64_t)(l->spec.temperatures_s * 1e9);
    if (l->temperatures_due_ns < l->t_ns)
        l->temperatures_due_ns = l->t_ns;
    enter(l, SIM_LASER_TEMPERATURES);
    sim_laser_step(l, l->t_ns);
    return SIM_LASER_ACCEPTED;
}

static void end(struct sim_laser *l, enum sim_laser_state state)
{
    if (l->state != SIM_LASER_OFF && l->spec.key_after_off)
        l->needs_key_cycle = true;
    if (l->state != SIM_LASER_FAULT)
        enter(l, state);
}

void sim_laser_off(struct sim_laser *l)
{
    l->last_off_ns = l->t_ns;
    l->offs++;
    if (!l->ignores_off)
        end(l, SIM_LASER_OFF);
}

void sim_laser_abort(struct sim_laser *l)
{
    end(l, SIM_LASER_ABORTED);
}

void sim_laser_clear_fault(struct sim_laser *l)
{
    if (l->fault == 3 && !l->interlock_closed)
        return; // it would be back at once
    l->fault = 0;
    if (l->state == SIM_LASER_FAULT)
        enter(l, SIM_LASER_OFF);
}

void sim_laser_set_key(struct sim_laser *l, bool on)
{
    if (l->key && !on) {
        if (sim_laser_emits(l))
            enter(l, SIM_LASER_OFF);
        l->needs_key_cycle = false;
        sim_laser_clear_fault(l);
    }
    l->key = on;
    sim_laser_step(l, l->t_ns);
}

void sim_laser_set_interlock(struct sim_laser *l, bool closed)
{
    if (!closed && l->interlock_closed && l->state != SIM_LASER_OFF) {
        enter(l, SIM_LASER_FAULT);
        l->needs_key_cycle = true;
    }
    l->interlock_closed = closed;
    if (!closed)
        l->fault = 3;
}

void sim_laser_drive(struct sim_laser *l, double power_w)
{
    l->warmth = 1;
    l->setpoint_w = power_w;
    enter(l, power_w > 0 ? SIM_LASER_COMPLETED : SIM_LASER_OFF);
}
