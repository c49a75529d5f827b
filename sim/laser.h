// SPDX-License-Identifier: MIT
// The laser as a physical thing with its controller's state machine: key, interlock, temperatures,
// warm-up, emission, and the power that comes out of it. Stepped by the time passed in; no I/O. The
// protocol in front of it is sim/cobolt. Thread: one.
//
// The states and faults are those of gom? and f? in public drivers of the Cobolt 05 series
// (sim/cobolt.h), and that the key may have to be cycled after off or a trip is pylablib's; how
// warmth and power go is chosen here.
//
// off -> waiting for temperatures (TEC) -> waiting for the key -> warming up (light, rising) ->
// completed. Opening the interlock while anything but off is on ends in fault 3 and asks for a key
// cycle. Warmth is one number that goes exponentially to 1 while emitting and to 0, four times
// slower, while not; warm-up is over when it lacks e^-8 = 3e-4, and takes warmup_s from cold.
#pragma once
#include "sim/noise.h"

#include <stdbool.h>
#include <stdint.h>

// Numbers as gom? gives them for the 05 series.
enum sim_laser_state {
    SIM_LASER_OFF = 0,
    SIM_LASER_TEMPERATURES = 1,
    SIM_LASER_KEY = 2,
    SIM_LASER_WARMING = 3,
    SIM_LASER_COMPLETED = 4,
    SIM_LASER_FAULT = 5,
    SIM_LASER_ABORTED = 6
};

enum sim_laser_refusal { // why emission was not switched on
    SIM_LASER_ACCEPTED,
    SIM_LASER_AUTOSTART, // direct on while autostart (CDRH) is enabled
    SIM_LASER_INTERLOCK, // open
    SIM_LASER_NO_KEY,    // key off, or it must be cycled
    SIM_LASER_FAULTY     // a fault is latched
};

struct sim_laser_spec {
    double power_max_w;            // > 0
    double power_w;                // set-point at power-up
    double temperatures_s;         // until the TECs are at their set-points
    double warmup_s;               // from cold, > 0
    double drift_rms, drift_tau_s; // slow, relative
    double rin_rms, rin_tau_s;     // relative intensity noise: fast, relative
    bool key_after_off;            // the key must be cycled after each off
};

struct sim_laser {
    struct sim_laser_spec spec;
    int64_t t_ns;
    enum sim_laser_state state;
    int fault; // 0 none, 3 interlock
    bool key, needs_key_cycle, interlock_closed, autostart;
    bool constant_current; // else constant power
    double setpoint_w, current_a;
    double warmth; // 0..1
    int64_t temperatures_due_ns;
    struct noise noise;
    struct noise_drift drift, rin;
    double drift_due_s; // the drift is too slow to be stepped each time
    bool ignores_off;   // fault injection: off is answered and nothing happens
    // what a test wants to know
    int64_t emission_since_ns;       // when it last changed
    int64_t last_off_ns, last_on_ns; // commands; INT64_MIN: never
    uint64_t offs, ons;
};

void sim_laser_init(struct sim_laser *l, const struct sim_laser_spec *spec, uint64_t seed,
                    int64_t t_ns);
void sim_laser_step(struct sim_laser *l, int64_t t_ns); // to t_ns; earlier times change nothing

// Commands, at the time of the last step.
enum sim_laser_refusal sim_laser_start(struct sim_laser *l, bool autostart_sequence);
void sim_laser_off(struct sim_laser *l);
void sim_laser_abort(struct sim_laser *l);
void sim_laser_clear_fault(struct sim_laser *l);
void sim_laser_set_key(struct sim_laser *l, bool on); // off and on again is a cycle
void sim_laser_set_interlock(struct sim_laser *l, bool closed);

// For a controller that has a state machine of its own (sim/actor_world.h): light of this power
// from now on, 0: none. What remains of this laser are drift and noise.
void sim_laser_drive(struct sim_laser *l, double power_w);

bool sim_laser_emits(const struct sim_laser *l);
double sim_laser_power_w(const struct sim_laser *l);   // of the beam, now
double sim_laser_current_a(const struct sim_laser *l); // diode
