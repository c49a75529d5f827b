// SPDX-License-Identifier: MIT
#include "campaign/keepout.h"

#include <assert.h>
#include <math.h>
#include <string.h>

// Of one question; what is not answered by then counts as blocked. A way is looked for while the
// laser waits for its lease: with 16 stations and 8 keep-outs of 16 corners 56 ms at most.
enum { MOST_BOXES = 500 };

#define FINEST_DEG (KEEPOUT_MARGIN_DEG / 4)

static const unsigned everything = (1u << BENCH_AXES) - 1;
static_assert(BENCH_AXES < 32, "a bit an axis");

// --- a rectangle and a polygon -------------------------------------------------------------------

struct rectangle {
    double low[2], high[2];
};

static bool contains(const struct bench_keep_out *k, double x, double y)
{
    bool inside = false;
    for (int i = 0, j = k->vertices - 1; i < k->vertices; j = i++) {
        const double *a = k->vertex[i], *b = k->vertex[j];
        if ((a[1] > y) != (b[1] > y) && x < (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) + a[0])
            inside = !inside;
    }
    return inside;
}

// Liang and Barsky: the part of the segment that is within both bands.
static bool edge_meets(const struct rectangle *r, const double *a, const double *b)
{
    double first = 0, last = 1;
    for (int c = 0; c < 2; c++) {
        const double d = b[c] - a[c];
        if (d == 0) {
            if (a[c] < r->low[c] || a[c] > r->high[c])
                return false;
            continue;
        }
        const double t = (r->low[c] - a[c]) / d, u = (r->high[c] - a[c]) / d;
        first = fmax(first, fmin(t, u));
        last = fmin(last, fmax(t, u));
    }
    return first <= last;
}

static bool meets(const struct bench_keep_out *k, const struct rectangle *r)
{
    for (int i = 0, j = k->vertices - 1; i < k->vertices; j = i++)
        if (edge_meets(r, k->vertex[j], k->vertex[i]))
            return true;
    return contains(k, r->low[0], r->low[1]);
}

static struct rectangle around(double x, double y, double half_x, double half_y)
{
    return (struct rectangle){{x - half_x, y - half_y}, {x + half_x, y + half_y}};
}

int keepout_at(const struct bench_config *b, double theta_i, double theta_r)
{
    const struct rectangle r = around(theta_i, theta_r, KEEPOUT_MARGIN_DEG, KEEPOUT_MARGIN_DEG);
    for (int i = 0; i < b->keep_out_count; i++)
        if (meets(&b->keep_out[i], &r))
            return i;
    return -1;
}

// --- a box of axes -------------------------------------------------------------------------------

struct search {
    const struct bench_config *bench;
    const struct kinematics *kinematics;
    int boxes;
};

static int hit_of(const struct search *s, const struct kinematics_reach *reach)
{
    for (int side = 0; side <= reach->mirrored; side++) {
        const struct rectangle r = around(reach->theta_i, side ? -reach->theta_r : reach->theta_r,
                                          reach->half_theta_i + KEEPOUT_MARGIN_DEG,
                                          reach->half_theta_r + KEEPOUT_MARGIN_DEG);
        for (int i = 0; i < s->bench->keep_out_count; i++)
            if (meets(&s->bench->keep_out[i], &r))
                return i;
    }
    return -1;
}

// Halves the longest side until the rectangle that bounds the box is clear or as good as a point.
static int search_box(struct search *s, const double at[BENCH_AXES], const double half[BENCH_AXES])
{
    const struct kinematics_reach reach = kinematics_reach(s->kinematics, at, half);
    const int hit = hit_of(s, &reach);
    if (hit < 0 || fmax(reach.half_theta_i, reach.half_theta_r) <= FINEST_DEG ||
        ++s->boxes > MOST_BOXES)
        return hit;
    double part_at[BENCH_AXES], part_half[BENCH_AXES];
    int longest = 0;
    for (int i = 1; i < BENCH_AXES; i++)
        if (half[i] > half[longest])
            longest = i;
    memcpy(part_half, half, sizeof part_half);
    memcpy(part_at, at, sizeof part_at);
    part_half[longest] /= 2;
    for (int side = -1; side <= 1; side += 2) {
        part_at[longest] = at[longest] + side * part_half[longest];
        const int found = search_box(s, part_at, part_half);
        if (found >= 0)
            return found;
    }
    return -1;
}

int keepout_within(const struct bench_config *b, const struct kinematics *k,
                   const double low[BENCH_AXES], const double high[BENCH_AXES])
{
    struct search s = {b, k, 0};
    double at[BENCH_AXES] = {0}, half[BENCH_AXES] = {0};
    for (int i = 0; i < b->axes_count; i++)
        if (kinematics_steers(k, i)) {
            at[i] = (low[i] + high[i]) / 2;
            half[i] = (high[i] - low[i]) / 2;
        }
    return b->keep_out_count ? search_box(&s, at, half) : -1;
}

// --- ways ----------------------------------------------------------------------------------------

struct move {
    const struct bench_config *bench;
    const struct kinematics *kinematics;
    const double *from, *to;
    unsigned steering; // what of its axes the angles depend on
};

static unsigned steering_axes(const struct bench_config *b, const struct kinematics *k,
                              const double to[BENCH_AXES])
{
    unsigned axes = 0;
    for (int i = 0; i < b->axes_count; i++)
        axes |= kinematics_steers(k, i) && !isnan(to[i]) ? 1u << i : 0;
    return axes;
}

// What is in the way when the axes of a mask move, those of done stand at their targets, and the
// others where they began.
static int blocked_by(const struct move *m, unsigned done, unsigned moving)
{
    double low[BENCH_AXES], high[BENCH_AXES];
    for (int i = 0; i < m->bench->axes_count; i++) {
        const struct bench_axis *a = &m->bench->axes[i];
        const double off = done >> i & 1 ? bench_axis_tolerance(a) : 0;
        low[i] = (done >> i & 1 ? m->to[i] : m->from[i]) - off;
        high[i] = low[i] + 2 * off;
        if (moving >> i & 1)
            bench_axis_span(a, m->from[i], m->to[i], &low[i], &high[i]);
    }
    return keepout_within(m->bench, m->kinematics, low, high);
}

static void add_stage(struct keepout_way *way, const struct move *m, unsigned axes)
{
    struct keepout_stage *stage = &way->stage[way->stages++];
    stage->axes = axes;
    memcpy(stage->to, m->to, sizeof stage->to);
}

// One after the other: the first order of the axes still to move that is clear.
static bool find_order(const struct move *m, unsigned done, struct keepout_way *way)
{
    const unsigned left = m->steering & ~done;
    for (int i = 0; i < m->bench->axes_count; i++) {
        const unsigned one = 1u << i;
        if (!(left & one) || blocked_by(m, done, one) >= 0)
            continue;
        add_stage(way, m, one);
        if (find_order(m, done | one, way))
            return true;
        way->stages--;
    }
    return !left;
}

// Together, or one after the other. What steers nothing goes with the first.
static bool find_straight(const struct move *m, struct keepout_way *way)
{
    const int first = way->stages;
    if (blocked_by(m, 0, m->steering) < 0)
        add_stage(way, m, m->steering);
    else if (!find_order(m, 0, way))
        return false;
    way->stage[first].axes |= everything & ~m->steering;
    return true;
}

// By a place: there, and on from there.
static bool find_by(const struct move *m, const double at[BENCH_AXES], struct keepout_way *way)
{
    struct move there = *m, on = *m;
    there.to = on.from = at;
    way->stages = 0;
    return find_straight(&there, way) && find_straight(&on, way);
}

// Only the axes that steer go to the station: the sample stays in.
static bool find_by_station(const struct move *m, const struct bench_station *s,
                            struct keepout_way *way)
{
    double at[BENCH_AXES];
    if (bench_station_at(m->bench, m->kinematics, s, at, NULL) < 0)
        return false;
    for (int i = 0; i < BENCH_AXES; i++)
        if (!(m->steering >> i & 1))
            at[i] = m->from[i];
    return find_by(m, at, way);
}

// One axis steps aside to an end of its travel, out of a corner that it went into.
static bool find_aside(const struct move *m, int axis, struct keepout_way *way)
{
    const double ends[] = {m->bench->axes[axis].min, m->bench->axes[axis].max};
    bool found = false;
    for (int k = 0; k < 2 && m->steering >> axis & 1 && !found; k++) {
        double at[BENCH_AXES];
        memcpy(at, m->from, sizeof at);
        at[axis] = ends[k];
        found = find_by(m, at, way);
    }
    return found;
}

static int no_way(const struct move *m, struct gon_error *err)
{
    double to[BENCH_AXES];
    for (int i = 0; i < BENCH_AXES; i++)
        to[i] = isnan(m->to[i]) ? m->from[i] : m->to[i];
    const struct kinematics_pose a = kinematics_forward(m->kinematics, m->from);
    const struct kinematics_pose b = kinematics_forward(m->kinematics, to);
    const int from_hit = keepout_at(m->bench, a.theta_i, a.theta_r);
    const int to_hit = keepout_at(m->bench, b.theta_i, b.theta_r);
    const int hit = from_hit >= 0 ? from_hit : to_hit >= 0 ? to_hit : blocked_by(m, 0, m->steering);
    const char *where = from_hit >= 0 ? "the bench stands in it; move it out by hand"
                        : to_hit >= 0 ? "the target lies in it"
                                      : "it lies between, whichever axis moves first";
    return gon_fail(err, GON_E_INPUT,
                    "no way from theta_i %.3f, theta_r %.3f to %.3f, %.3f deg round keep-out "
                    "\"%s\": %s",
                    a.theta_i, a.theta_r, b.theta_i, b.theta_r, m->bench->keep_out[hit].name,
                    where);
}

int keepout_find_way(const struct bench_config *b, const struct kinematics *k,
                     const double from[BENCH_AXES], const double to[BENCH_AXES],
                     struct keepout_way *ret_way, struct gon_error *err)
{
    const struct move m = {b, k, from, to, steering_axes(b, k, to)};
    struct keepout_way way = {0};
    bool found = !b->keep_out_count || !m.steering;
    for (int i = 0; i < b->axes_count && !found; i++)
        if (kinematics_steers(k, i) && isnan(from[i]))
            return gon_fail(err, GON_E_INPUT, "axis %s: where it stands is not known",
                            b->axes[i].name);
    if (found)
        add_stage(&way, &m, everything);
    else
        found = find_straight(&m, &way);
    for (int i = 0; i < b->stations_count && !found; i++)
        found = find_by_station(&m, &b->stations[i], &way);
    for (int i = 0; i < b->axes_count && !found; i++)
        found = find_aside(&m, i, &way);
    if (!found)
        return no_way(&m, err);
    *ret_way = way;
    return GON_OK;
}
