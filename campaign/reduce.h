// SPDX-License-Identifier: MIT
// From volts to absolute BRDF with its uncertainty (GUM: type A and B kept apart).
//
//   underfilled  f = [(S - Ds)/(M - Dm)] / [(S0 - Ds0)/(M0 - Dm0)] / (Omega cos theta_r)
//   overfilled   the same over (Omega cos theta_i), the beam reading being that of the
//                field of view
//
// S signal, M monitor (1 without one), D dark with the laser off, 0 the beam; Omega = pi r^2/d^2.
// Opening and closing beam and dark are averaged; half their difference is part of their
// uncertainty. Angles are those of the encoders. Excluded readings (campaign/store_exclude.h) count
// nowhere.
//
// References may be measured again, as further accepted readings of the same points: the opening
// ones after a gap (a pause, a stop), opening and closing ones with a sweep that is measured again.
// All that count are kept. Each reading is then reduced with what the references before and after
// it give, linear in time between them (campaign/reduce_series.h), so that each day has its own;
// their uncertainty has half of the largest difference of neighbours, for all readings.
//
// Each reading is divided by the beam of its own pol_in, which is measured without analyser; f of
// a reading behind the analyser is divided by its transmission T as well, so that f = 1/2 a^T F g
// of an ideal one. Where the analyser cannot be taken out T cancels and what it passes of the
// beam's light (polarisation_passed) is multiplied in. Only a bench whose elements move knows of
// either: without pol_out states in its file the analyser stood in the beam as on the sample.
//
// A filter that stands in the beam alone (bench_beam_passes) divides the beam by what it passes.
//
// u_A, uncorrelated from point to point: noise of signal and monitor, and of the dark. With four
// samples a point the scatter of one point says little (its sd is uncertain by 40 %), and weights
// from it would favour points that happened to scatter little. So one model for all,
//   variance of a sample = floor^2 + (rel S)^2,
// is fitted to all accepted readings' sample variances by maximum likelihood (they follow a gamma
// distribution with (count - 1)/2 degrees of shape). Likewise rel_monitor.
// Fluctuations of the laser that the monitor divides out count in both: u_A is rather too large
// than too small.
// u_B, common to all points of a channel (a pol_in and pol_out) as one factor: beam, 2u(r)/r,
// 2u(d)/d, linearity, u(T)/T, the filter's. Elements that pass up to a part e of crossed light add
// 0..e f_x to f; u_B has e f_x/sqrt(3) of it (rectangular, not corrected), f_x being the reading of
// the crossed state in the same direction where there is one, else f itself. Thread: any.
#pragma once
#include "base/err.h"
#include "campaign/bench.h"
#include "campaign/plan.h"
#include "campaign/store.h"

struct reduced_point {
    int sweep, point, attempt;
    int index;                       // of its point in the plan
    int pol_in, pol_out;             // enum polarisation
    double theta_i_deg, theta_r_deg; // from the encoders; theta_r signed
    double f_per_sr;
    double u_a_per_sr; // NAN when no reading had two samples or none scattered
    double u_b_per_sr;
    double weight; // of the plan
};

struct reduce_noise {
    double floor_v, rel; // of one sample; NAN: unknown
    double rel_monitor;  // of one sample; 0 without monitor
};

struct reduce_reference { // means of the accepted readings; NAN where there is none
    double dark_signal_v, dark_monitor_v;
    double beam_signal_v[POL_COUNT], beam_monitor_v[POL_COUNT]; // by the light's state
};

struct reduce_channel {
    int pol_in, pol_out;
    double beam_ratio; // [(S0 - Ds0)/(M0 - Dm0)], as a reading of f = 1 per sr would divide it
    double u_beam_rel, u_analyser_rel, u_filter_rel;
    double u_scale_rel; // these and what all channels share
};

struct reduction {
    struct reduced_point *points; // in the plan's order
    int count;
    int left_out;     // points on the sample that were measured and could not be reduced (cosine,
                      // monitor)
    int beams, darks; // how many readings the references are means of
    int excluded;     // accepted readings, references too, that do not count, as somebody decided
    double omega_sr;
    struct reduce_reference reference;
    double u_dark_v; // of the dark signal's mean
    struct reduce_noise noise;
    double u_beam_rel; // the largest of the channels
    double u_radius_rel, u_distance_rel, u_linearity_rel;
    double u_scale_rel; // all of them; the largest of the channels
    int regime;         // enum bench_regime
    int polarisation;   // of the light on the sample; POL_UNKNOWN when any of it is
    struct reduce_channel channel[CAMPAIGN_CHANNELS]; // in the plan's order
    int channels;
};

// What the numbers are not, in one sentence: with a laser of unknown polarisation they are neither
// f_00 nor anything else that could be named. Returns the length that snprintf would; 0: nothing to
// say.
int reduction_warning(const struct reduction *r, char *text, size_t size);

// Rows as store_read_readings gives them (-1). GON_E_INPUT: no dark yet, or no beam in one of
// the light's states, or all of them excluded; or a beam that is not above the dark.
int reduce_run(const struct bench_config *bench, const struct plan *plan,
               const struct store_reading *rows, int count, struct reduction *ret_reduction,
               struct gon_error *err);
// The same from a campaign file, with the bench that is kept in it.
int reduce_campaign(struct store *s, struct reduction *ret_reduction, struct gon_error *err);
void reduction_clear(struct reduction *r); // frees what it holds, not r; NULL is fine

// The newest opening references (sweep 0), for provisional values after a resume.
struct reduce_reference reduce_opening(const struct plan *plan, const struct store_reading *rows,
                                       int count);

// The noise model alone.
struct reduce_noise reduce_noise_of(const struct plan *plan, const struct store_reading *rows,
                                    int count);
