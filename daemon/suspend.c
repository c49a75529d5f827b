// SPDX-License-Identifier: MIT
#include "daemon/suspend.h"

#include "base/clk.h"
#include "campaign/bench.h"

#include <math.h>
#include <stdio.h>

void suspend_init(struct suspend *s, const struct bench_config *bench)
{
    *s = (struct suspend){.bench = bench};
    for (int i = 0; i < bench->suspenders_count; i++) {
        struct bench_condition *c = &s->one[i].condition;
        bench_condition_parse(bench->suspenders[i].when, c, NULL);
        s->one[i].quiet_ns = INT64_MIN;
        for (int k = 0; k < c->terms; k++)
            s->one[i].needs_light = s->one[i].needs_light || bench_term_needs_light(&c->term[k]);
    }
}

bool suspend_uses(const struct suspend *s, bool (*is)(const struct bench_term *t))
{
    for (int i = 0; i < s->bench->suspenders_count; i++)
        for (int k = 0; k < s->one[i].condition.terms; k++)
            if (is(&s->one[i].condition.term[k]))
                return true;
    return false;
}

// All of its terms; the text says what each one saw.
static bool holds(const struct bench_condition *c, const struct suspend_source *source,
                  char text[160])
{
    size_t used = 0;
    for (int k = 0; k < c->terms; k++) {
        double value;
        if (!source->value(source->ctx, &c->term[k], &value) ||
            !bench_term_holds(&c->term[k], value))
            return false;
        char said[120];
        bench_term_text(&c->term[k], value, said, sizeof said);
        if (used < 160)
            used += (size_t)snprintf(text + used, 160 - used, "%s%s", k ? ", " : "", said);
    }
    return c->terms > 0;
}

void suspend_look(struct suspend *s, int64_t now_ns, const struct suspend_source *source)
{
    for (int i = 0; i < s->bench->suspenders_count; i++) {
        char text[160];
        const bool held = s->one[i].holds;
        s->one[i].holds = holds(&s->one[i].condition, source, text);
        if (s->one[i].holds) {
            snprintf(s->one[i].text, sizeof s->one[i].text, "%s", text);
            s->one[i].latched = s->bench->suspenders[i].resume == BENCH_MANUAL;
        } else if (held) {
            s->one[i].quiet_ns = now_ns;
        }
    }
}

void suspend_release(struct suspend *s)
{
    for (int i = 0; i < s->bench->suspenders_count; i++)
        s->one[i].latched = s->one[i].latched && s->one[i].holds;
}

static double left_s(const struct suspend *s, int i, int64_t now_ns)
{
    const double settle_s = s->bench->suspenders[i].settle_s;
    if (s->one[i].holds)
        return settle_s;
    if (s->one[i].quiet_ns == INT64_MIN)
        return 0;
    return fmax(0, settle_s - (double)(now_ns - s->one[i].quiet_ns) * 1e-9);
}

struct suspender_state suspend_state(const struct suspend *s, int index, int64_t now_ns)
{
    const struct bench_suspender *b = &s->bench->suspenders[index];
    struct suspender_state state = {.name = b->name,
                                    .manual = b->resume == BENCH_MANUAL,
                                    .holds = s->one[index].holds,
                                    .needs_light = s->one[index].needs_light,
                                    .settle_s = b->settle_s,
                                    .left_s = left_s(s, index, now_ns)};
    state.waits = s->one[index].latched && !state.holds;
    state.keeps = state.holds || state.waits || state.left_s > 0;
    snprintf(state.text, sizeof state.text, "%s", s->one[index].text);
    return state;
}

int suspend_first(const struct suspend *s, int64_t now_ns)
{
    int first = -1;
    for (int i = 0; i < s->bench->suspenders_count; i++) {
        if (s->one[i].holds)
            return i;
        if (first < 0 && suspend_state(s, i, now_ns).keeps)
            first = i;
    }
    return first;
}
