// SPDX-License-Identifier: MIT
#include "tests/dst/mutation.h"

#include "sim/modbus.h"
#include "tests/dst/trial.h"

#include <string.h>

enum { READINGS = 200, ROW = 20 };

// --- behind the engine's back --------------------------------------------------------------------

static void tell_laser(struct trial *t, const char *command)
{
    struct sim_cobolt_port *p = &t->rig.bench.laser_port[!t->rig.spec.tcp[RIG_LASER]];
    t->rig.bench.laser.last_ns = INT64_MIN; // it has been quiet for long enough
    port_feed(&p->port, (const uint8_t *)command, strlen(command), os.now_ns);
    p->port.count = 0;
    watch_step(&t->watch, os.now_ns);
}

static void light_in_a_pause(void *ctx, int arg)
{
    (void)arg;
    tell_laser(ctx, "@cob1\r");
}

static void pause_and_switch_on(struct trial *t)
{
    t->wants_pause = true;
    os_at(os.now_ns + OS_S(2.5), light_in_a_pause, t, 0);
}

static void hang(struct trial *t)
{
    (void)t;
    os_sleep(OS_S(0.8)); // without a breath
}

static void interlock(struct trial *t)
{
    struct sim_laser *l = &t->rig.bench.world.laser;
    sim_laser_off(l);
    watch_step(&t->watch, os.now_ns);
    l->interlock_closed = false;
    l->state = SIM_LASER_TEMPERATURES; // a laser that does not mind its interlock
    watch_step(&t->watch, os.now_ns);
    l->interlock_closed = true;
}

static void ignore_alarm(struct trial *t)
{
    t->rig.gate[2].hides_alarm = true; // as if the engine did not look
    t->rig.bench.az[2].alarm = SIM_AZ_OVERLOAD;
}

// As the AZ takes it: type 1, position, speed, rates, current, trigger.
static void send_axis(struct trial *t, int unit, double to)
{
    const int32_t steps = (int32_t)(to * rig_steps_per_unit());
    const uint16_t r[16] = {0,
                            0,
                            0,
                            1,
                            (uint16_t)((uint32_t)steps >> 16),
                            (uint16_t)steps,
                            0,
                            60000,
                            9,
                            10176,
                            9,
                            10176,
                            0,
                            1000,
                            0,
                            1};
    sim_az_write(&t->rig.bench.az[unit], 0x58, 16, r, os.now_ns);
    watch_step(&t->watch, os.now_ns);
}

static void beyond_limits(struct trial *t)
{
    send_axis(t, 0, 92.0);
}

static void unhomed(struct trial *t)
{
    t->rig.bench.az[1].homed = false;
    watch_step(&t->watch, os.now_ns);
    t->watch.unhomed_ns[1] -= OS_S(5);
    send_axis(t, 1, 10.0);
}

static void into_keep_out(struct trial *t)
{
    send_axis(t, 0, 65.0);
    send_axis(t, 1, -35.0);
    os_sleep(OS_S(0.2));
    for (int i = 0; i < 40; i++) {
        os_sleep(OS_S(0.1));
        watch_breath(&t->watch);
    }
}

static void wait_for_ever(struct trial *t)
{
    t->wants_pause = true;
    t->no_operator = true;
}

// --- in the ports --------------------------------------------------------------------------------

static void another_value(struct store_reading *stored, struct store_reading *told)
{
    stored->signal_v *= 1.01;
    *told = *stored;
}

static void old_place(struct store_reading *stored, struct store_reading *told)
{
    stored->theta_r_udeg -= 500000;
    *told = *stored;
}

static void accepted_anyway(struct store_reading *stored, struct store_reading *told)
{
    stored->flags = 0;
    *told = *stored;
}

static void changed_on_the_way(struct store_reading *stored, struct store_reading *told)
{
    (void)told;
    stored->monitor_v += 1e-9;
}

// --- in what is said -----------------------------------------------------------------------------

static void without_reason(struct engine_event *e)
{
    if (e->state == RUN_PAUSED)
        e->text = "";
}

static void calls_it_off(struct engine_event *e)
{
    if (e->kind == ENGINE_STATE && e->state == RUN_RUNNING)
        e->text = "laser off";
}

static const struct mutation mutations[] = {
    {"light in a pause", "ON is sent while the campaign is paused", WATCH_EMISSION,
     "switched on while the campaign is paused", ROW, pause_and_switch_on, NULL, NULL, false},
    {"hang", "0.8 s without renewing the lease", WATCH_EMISSION, "without a breath", ROW, hang,
     NULL, NULL, false},
    {"interlock", "ON takes effect with the interlock open", WATCH_EMISSION, "interlock open", ROW,
     interlock, NULL, NULL, false},
    {"alarm", "an axis's alarm is not looked at", WATCH_EMISSION, "after an alarm", ROW,
     ignore_alarm, NULL, NULL, false},
    {"limits", "an axis is sent beyond its travel", WATCH_MOTION, "beyond", ROW, beyond_limits,
     NULL, NULL, false},
    {"unhomed", "an axis without home is sent somewhere", WATCH_MOTION, "not homed", ROW, unhomed,
     NULL, NULL, false},
    {"keep-out", "two axes are sent into a keep-out", WATCH_MOTION, "keep-out lamp", ROW,
     into_keep_out, NULL, NULL, false},
    {"value", "values are stored 1 % too large", WATCH_VALUES, "never measured", 0, NULL,
     another_value, NULL, false},
    {"place", "rows carry the direction before", WATCH_VALUES, "it was", 0, NULL, old_place, NULL,
     false},
    {"flags", "rows lose their flags", WATCH_ROWS, "accepted twice", 0, NULL, accepted_anyway, NULL,
     false},
    {"lost", "a row is acknowledged and not stored", WATCH_ROWS, "not in the file", ROW, NULL, NULL,
     NULL, true},
    {"changed", "rows change on their way to the file", WATCH_ROWS, "not in the file", 0, NULL,
     changed_on_the_way, NULL, false},
    {"reason", "pauses give no reason", WATCH_WORDS, "without a reason", ROW, wait_for_ever, NULL,
     without_reason, false},
    {"laser off", "it is called off while it is on", WATCH_WORDS, "with the light on", 0, NULL,
     NULL, calls_it_off, false},
    {"for ever", "a pause that nobody ends", WATCH_WORDS, "no reading for", ROW, wait_for_ever,
     NULL, NULL, false},
};

void mutation_after_row(struct trial *t)
{
    const struct mutation *m = t->spec.mutation;
    if (m && m->happen && t->watch.rows == m->row)
        m->happen(t);
}

bool mutation_of_reading(const struct trial *t, struct store_reading *stored,
                         struct store_reading *told)
{
    const struct mutation *m = t->spec.mutation;
    if (m && m->reading)
        m->reading(stored, told);
    return m && m->keep && t->watch.rows == m->row;
}

void mutation_of_event(const struct trial *t, struct engine_event *event)
{
    if (t->spec.mutation && t->spec.mutation->event)
        t->spec.mutation->event(event);
}

int mutation_run_all(const char *profiles, FILE *out)
{
    int missed = 0;
    for (size_t i = 0; i < sizeof mutations / sizeof mutations[0]; i++) {
        const struct mutation *m = &mutations[i];
        struct trial_result r;
        struct rig_spec rig;
        rig_draw(&rig, 1);
        rig.controller = BENCH_AZ;
        rig.keep_out = true;
        const struct trial_spec spec = {.seed = 1,
                                        .readings = READINGS,
                                        .profiles = profiles,
                                        .rig = &rig,
                                        .fault = -1,
                                        .mutation = m};
        trial_run(&spec, &r);
        const bool seen = r.rules[m->rule] > 0 && strstr(r.texts[m->rule], m->words);
        fprintf(out, "%-18s%-44s%s %s\n", m->name, m->what, seen ? "reported:" : "NOT REPORTED:",
                *r.texts[m->rule] ? r.texts[m->rule] : r.text);
        missed += !seen;
    }
    return missed;
}
