// SPDX-License-Identifier: MIT
#include "sim/world.h"

#include <math.h>
#include <string.h>

#define STEPS_PER_TC 8
#define BACK_TC 60

const char *const world_axis_names[WORLD_AXES] = {"theta_i", "theta_r", "sample", "polariser",
                                                  "analyser"};

int world_axes(const struct world_spec *spec)
{
    return spec->elements.present ? WORLD_AXES : WORLD_POLARISER;
}

// A beam of 50 mW is 0.8 V, below the 1 V range; f = 0.05/sr at theta_r = 45 deg is 23 uV, 500
// times the noise of 4 nV/rtHz through 12 dB per octave at 1 ms (45 nV).
void world_defaults(struct world_spec *ret_spec)
{
    *ret_spec = (struct world_spec){
        .seed = 1,
        .optics = {.sample = {.n = 1.5, .k = 0.02, .sigma = 0.15, .ks = 0.9, .kd = 0.05},
                   .diffuse = BRDF_DIFFUSE_PAPER,
                   .aperture_radius_mm = 8,
                   .distance_mm = 500,
                   .divergence_deg = 0.05,
                   .transmission = 1,
                   .sample_in_mm = 5,
                   .sample_out_mm = 25},
        .elements = {.laser = BRDF_STATE_U,
                     .polariser = {.transmission = 0.9, .extinction = 1e-5},
                     .analyser = {.transmission = 0.9, .extinction = 1e-5}},
        .axis = {{.min = -10, .max = 95, .start = 2.5, .backlash = 0.015},
                 {.min = -185, .max = 185, .start = -7.5, .backlash = 0.015},
                 {.min = -2, .max = 35, .start = 1.0, .backlash = 0},
                 {.min = -15, .max = 285, .start = 12.0, .backlash = 0.015},
                 {.min = -15, .max = 285, .start = 21.0, .backlash = 0.015}},
        .laser = {.power_max_w = 0.1,
                  .power_w = 0.01,
                  .temperatures_s = 20,
                  .warmup_s = 240,
                  .drift_rms = 2e-3,
                  .drift_tau_s = 1800,
                  .rin_rms = 1e-4,
                  .rin_tau_s = 0.005},
        .responsivity_v_per_w = 16,
        .offset_v = 2e-7,
        .noise_v_per_rthz = 4e-9,
        .monitor_v_per_w = 40,
        .monitor_dark_v = 0.002,
        .monitor_noise_v = 2e-4,
        .reference_hz = 1000,
    };
}

void world_init(struct world *w, const struct world_spec *spec, int64_t t_ns)
{
    memset(w, 0, sizeof *w);
    w->spec = *spec;
    w->t_ns = t_ns;
    w->lets_out = w->lets_in = 1;
    for (int i = 0; i < WORLD_AXES; i++) {
        const struct world_axis_spec *a = &spec->axis[i];
        motion_init(&w->axis[i], a->min, a->max, a->backlash, a->start);
    }
    sim_laser_init(&w->laser, &spec->laser, spec->seed, t_ns);
    lockin_init(&w->lockin, spec->noise_v_per_rthz, spec->seed);
    noise_init(&w->monitor_noise, spec->seed, 300);
    w->view.per_w = (double)NAN;
    world_settle(w);
}

static bool seen(const struct world *w)
{
    bool same = !isnan(w->view.per_w) && w->view.off == w->spec.optics.off;
    for (int i = 0; i < WORLD_AXES; i++)
        same = same && w->view.plan[i] == w->axis[i].plan && w->view.motor0[i] == w->axis[i].motor0;
    return same;
}

static void follow_light(struct world *w, int64_t t_ns)
{
    if (w->light.at)
        sim_laser_drive(&w->laser, w->light.at(w->light.ctx, t_ns));
    sim_laser_step(&w->laser, t_ns);
}

static void follow_places(struct world *w, int64_t t_ns)
{
    for (int i = 0; i < WORLD_AXES; i++)
        if (w->place[i].at)
            motion_put(&w->axis[i], w->place[i].at(w->place[i].ctx, t_ns), t_ns);
}

// Optics is most of the work, and most of the time nothing moves.
static double detected_per_w(struct world *w, int64_t t_ns)
{
    double at[WORLD_AXES];
    bool rest = true;
    follow_places(w, t_ns);
    if (seen(w))
        return w->view.per_w;
    for (int i = 0; i < WORLD_AXES; i++) {
        struct motion_state s = motion_at(&w->axis[i], t_ns);
        at[i] = s.load;
        rest = rest && !s.moving && t_ns >= w->axis[i].start_ns;
        w->view.plan[i] = w->axis[i].plan;
        w->view.motor0[i] = w->axis[i].motor0;
    }
    struct elements_view view =
        elements_view(&w->spec.elements, at[WORLD_POLARISER], at[WORLD_ANALYSER]);
    struct optics_scene scene = {at[WORLD_THETA_I], at[WORLD_THETA_R], at[WORLD_SAMPLE], 1,
                                 elements_are_idle(&w->spec.elements) ? NULL : &view};
    double per_w = optics_detected_w(&w->spec.optics, &scene);
    w->view.off = w->spec.optics.off;
    w->view.per_w = rest ? per_w : (double)NAN;
    return per_w;
}

double world_input_v(struct world *w, int64_t t_ns)
{
    double power_w = sim_laser_power_w(&w->laser);
    double detected_w =
        power_w > 0 ? power_w * w->lets_out * w->lets_in * detected_per_w(w, t_ns) : 0;
    double v = w->spec.responsivity_v_per_w * detected_w + w->spec.offset_v;
    return w->saturate ? v + 10 : v;
}

void world_settle(struct world *w)
{
    double v = world_input_v(w, w->t_ns);
    for (int k = 0; k < LOCKIN_POLES; k++) {
        w->lockin.x[k] = v * cos(w->lockin.phase_rad);
        w->lockin.y[k] = -v * sin(w->lockin.phase_rad);
    }
}

void world_see(struct world *w, int64_t t_ns)
{
    double most_ns = BACK_TC * w->lockin.time_constant_s * 1e9;
    if (t_ns - w->t_ns > most_ns) {
        w->t_ns = t_ns - (int64_t)most_ns;
        follow_light(w, w->t_ns);
    }
    int64_t step_ns = (int64_t)fmin(w->lockin.time_constant_s * 1e9 / STEPS_PER_TC, 1e15);
    while (w->t_ns < t_ns) {
        int64_t next_ns = t_ns - w->t_ns > step_ns ? w->t_ns + step_ns : t_ns;
        int64_t middle_ns = w->t_ns + (next_ns - w->t_ns) / 2;
        follow_light(w, middle_ns);
        lockin_step(&w->lockin, world_input_v(w, middle_ns), (double)(next_ns - w->t_ns) * 1e-9);
        w->t_ns = next_ns;
    }
    follow_light(w, t_ns);
    follow_places(w, t_ns);
}

double world_aux_v(struct world *w, int input)
{
    double v = w->spec.monitor_noise_v * noise_normal(&w->monitor_noise);
    if (input == 1)
        v += w->spec.monitor_dark_v +
             w->spec.monitor_v_per_w * w->lets_out * sim_laser_power_w(&w->laser);
    v = fmin(fmax(v, -10.5), 10.5);
    return rint(v * 3000) / 3000;
}
