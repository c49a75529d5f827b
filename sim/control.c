// SPDX-License-Identifier: MIT
#include "sim/control.h"
#include "sim/actor_control.h"
#include "sim/request.h"

static struct bench *the(const struct request *r)
{
    return r->subject;
}

static int the_axis(struct request *r)
{
    return request_choice(r, "axis", world_axis_names, world_axes(&the(r)->world.spec));
}

// --- what is asked -------------------------------------------------------------------------------

static json_t *axes_state(const struct request *r)
{
    json_t *all = json_object();
    for (int i = 0; i < world_axes(&the(r)->world.spec); i++) {
        const struct bench_motor a = bench_motor(the(r), (enum world_axis)i, r->t_ns);
        struct motion_state s = motion_at(&the(r)->world.axis[i], r->t_ns);
        json_object_set_new(all, world_axis_names[i],
                            json_pack("{s:f,s:f,s:f,s:b,s:b,s:i,s:i,s:I,s:I}", "motor", s.motor,
                                      "load", s.load, "speed", s.speed, "moving", s.moving, "homed",
                                      a.homed, "alarm", a.alarm, "steps", (int)a.steps, "moves",
                                      (json_int_t)a.moves, "ignored", (json_int_t)a.ignored));
    }
    return all;
}

static json_t *time_or_null(int64_t t_ns)
{
    return t_ns == INT64_MIN ? json_null() : json_integer(t_ns);
}

static json_t *laser_state(const struct request *r)
{
    const struct sim_laser *l = &the(r)->world.laser;
    const struct bench_actor *actor = bench_actor(the(r), BENCH_THE_LASER);
    const uint64_t too_early = actor ? actor->actor.too_early : the(r)->laser.too_early;
    return json_pack(
        "{s:b,s:I,s:f,s:f,s:i,s:i,s:b,s:b,s:b,s:o,s:o,s:I,s:I,s:I}", "emission", sim_laser_emits(l),
        "since_ns", (json_int_t)l->emission_since_ns, "power_w", sim_laser_power_w(l), "setpoint_w",
        l->setpoint_w, "state", l->state, "fault", l->fault, "key", l->key, "needs_key_cycle",
        l->needs_key_cycle, "interlock_closed", l->interlock_closed, "last_off_ns",
        time_or_null(l->last_off_ns), "last_on_ns", time_or_null(l->last_on_ns), "offs",
        (json_int_t)l->offs, "ons", (json_int_t)l->ons, "too_early", (json_int_t)too_early);
}

static json_t *detector_state(const struct request *r)
{
    const struct lockin *l = &the(r)->world.lockin;
    return json_pack("{s:f,s:f,s:i,s:f,s:i}", "input_v", world_input_v(&the(r)->world, r->t_ns),
                     "time_constant_s", l->time_constant_s, "poles", l->poles, "full_scale_v",
                     l->full_scale_v, "condition", (int)l->condition);
}

static void do_state(struct request *r)
{
    world_see(&the(r)->world, r->t_ns);
    json_object_set_new(r->out, "now_ns", json_integer(r->t_ns));
    json_object_set_new(r->out, "axes", axes_state(r));
    json_object_set_new(r->out, "laser", laser_state(r));
    json_object_set_new(r->out, "detector", detector_state(r));
    json_object_set_new(r->out, "wires", request_wires(r));
}

// What came over the laser's wires, oldest first.
static void do_heard(struct request *r)
{
    const struct sim_cobolt *c = &the(r)->laser;
    json_t *all = json_array();
    uint64_t i = c->heard_count > SIM_COBOLT_HEARD ? c->heard_count - SIM_COBOLT_HEARD : 0;
    for (; i < c->heard_count; i++) {
        const struct sim_cobolt_heard *h = &c->heard[i % SIM_COBOLT_HEARD];
        json_array_append_new(all, json_pack("{s:I,s:s,s:b}", "t_ns", (json_int_t)h->t_ns, "text",
                                             h->text, "too_early", h->too_early));
    }
    json_object_set_new(r->out, "heard", all);
}

static void do_truth(struct request *r)
{
    const struct world_spec *w = &the(r)->world.spec;
    const struct optics_spec *o = &w->optics;
    json_object_set_new(r->out, "seed", json_integer((json_int_t)w->seed));
    json_object_set_new(r->out, "sample",
                        json_pack("{s:f,s:f,s:f,s:f,s:f,s:s}", "n", o->sample.n, "k", o->sample.k,
                                  "sigma", o->sample.sigma, "ks", o->sample.ks, "kd", o->sample.kd,
                                  "diffuse",
                                  o->diffuse == BRDF_DIFFUSE_PAPER ? "paper" : "lambert"));
    json_object_set_new(r->out, "optics",
                        json_pack("{s:f,s:f,s:f,s:f}", "aperture_radius_mm", o->aperture_radius_mm,
                                  "distance_mm", o->distance_mm, "solid_angle_sr",
                                  optics_solid_angle_sr(o), "transmission", o->transmission));
    json_object_set_new(r->out, "detector",
                        json_pack("{s:f,s:f,s:f,s:f,s:f}", "responsivity_v_per_w",
                                  w->responsivity_v_per_w, "offset_v", w->offset_v,
                                  "noise_v_per_rthz", w->noise_v_per_rthz, "monitor_v_per_w",
                                  w->monitor_v_per_w, "monitor_dark_v", w->monitor_dark_v));
}

// --- what is done --------------------------------------------------------------------------------

static void do_power_cycle(struct request *r)
{
    int axis = the_axis(r);
    if (axis >= 0)
        bench_power_cycle(the(r), (enum world_axis)axis, r->t_ns);
}

// --- instruments made from profiles --------------------------------------------------------------

static struct bench_actor *the_actor(struct request *r)
{
    int part = request_choice(r, "part", bench_part_names, BENCH_PARTS);
    struct bench_actor *a = part < 0 ? NULL : bench_actor(the(r), part);
    if (part >= 0 && !a)
        request_refuse(r, "'%s' is not made from a profile", bench_part_names[part]);
    return a;
}

static void do_values(struct request *r)
{
    struct bench_actor *a = the_actor(r);
    if (a)
        actor_control_values(r, &a->actor);
}

static void set_values(struct request *r, json_t *values)
{
    struct bench_actor *a = the_actor(r);
    if (a)
        actor_control_set(r, &a->actor, values);
}

// What belongs to the laser that is built in.
static bool own_laser(struct request *r, const char *key)
{
    if (!bench_actor(the(r), BENCH_THE_LASER))
        return true;
    request_refuse(r,
                   "'%s' is of the laser that is built in; this one is made from a profile: set "
                   "its values (\"part\":\"laser\")",
                   key);
    return false;
}

static const char *const interlock_words[] = {"open", "closed"};
static const char *const key_words[] = {"off", "on"};

static void set_interlock(struct request *r, json_t *v)
{
    (void)v;
    int i = request_choice(r, "interlock", interlock_words, 2);
    if (i >= 0 && own_laser(r, "interlock"))
        sim_laser_set_interlock(&the(r)->world.laser, i == 1);
}

static void set_key(struct request *r, json_t *v)
{
    (void)v;
    int i = request_choice(r, "key", key_words, 2);
    if (i >= 0 && own_laser(r, "key"))
        sim_laser_set_key(&the(r)->world.laser, i == 1);
}

static void set_ignore_off(struct request *r, json_t *v)
{
    bool on = request_truth(r, "ignore_off", v);
    if (!*r->error && own_laser(r, "ignore_off"))
        the(r)->world.laser.ignores_off = on;
}

static void set_saturate(struct request *r, json_t *v)
{
    bool on = request_truth(r, "saturate", v);
    if (!*r->error)
        the(r)->world.saturate = on;
}

static void set_alarm(struct request *r, json_t *v)
{
    int axis = the_axis(r);
    json_int_t code = json_integer_value(v);
    if (!json_is_integer(v) || code < 1 || code > 255)
        request_refuse(r, "'alarm' must be a whole number, 1..255");
    else if (axis >= 0)
        bench_raise(the(r), (enum world_axis)axis, (int)code, r->t_ns);
}

static void set_term(struct request *r, json_t *v)
{
    const char *name = json_string_value(v);
    int i = name ? optics_term(name) : -1;
    json_t *on = json_object_get(r->in, "on");
    unsigned *off = &the(r)->world.spec.optics.off;
    if (i < 0)
        request_refuse(r, "'term' must be one of the optics' terms: %s, %s", optics_term_name(0),
                       optics_term_name(1));
    else if (request_truth(r, "on", on))
        *off &= ~(1u << i);
    else if (!*r->error)
        *off |= 1u << i;
}

static void do_set(struct request *r)
{
    static const struct request_key keys[] = {{"interlock", set_interlock},
                                              {"key", set_key},
                                              {"ignore_off", set_ignore_off},
                                              {"saturate", set_saturate},
                                              {"drop", request_set_drop},
                                              {"delay_ms", request_set_delay},
                                              {"alarm", set_alarm},
                                              {"values", set_values},
                                              {"part", NULL},
                                              {"term", set_term},
                                              {"wire", NULL},
                                              {"axis", NULL},
                                              {"on", NULL},
                                              {0}};
    world_see(&the(r)->world, r->t_ns);
    request_set(r, keys);
}

char *control_answer(struct bench *bench, struct wire *wires, const char *line, int64_t t_ns)
{
    static const struct request_verb verbs[] = {{"state", do_state},
                                                {"truth", do_truth},
                                                {"values", do_values},
                                                {"heard", do_heard},
                                                {"plug", request_plug},
                                                {"unplug", request_unplug},
                                                {"mute", request_mute},
                                                {"unmute", request_unmute},
                                                {"set", do_set},
                                                {"power-cycle", do_power_cycle},
                                                {0}};
    const struct request about = {.wires = wires, .wires_count = BENCH_PORTS, .subject = bench};
    return request_answer(&about, verbs, line, t_ns);
}
