// SPDX-License-Identifier: MIT
#include "daemon/arming.h"

#include "base/clk.h"
#include "campaign/bench.h"
#include "daemon/note.h"

static double bench_s(const struct arming *a)
{
    return a->rule->arm_h * 3600.0;
}

int arming_may_start(const struct arming *a, struct gon_error *err)
{
    struct gon_error why;
    if (a->align.running)
        return gon_fail(err, GON_E_REFUSED, "%s aligns the laser; end it: gonio laser off",
                        a->align.name);
    if (a->rule->arm == BENCH_ARM_RUN)
        return 0;
    if (arm_check(&a->seen, clk_now_ns(clk_system()), &why) == 0)
        return 0;
    return gon_fail(err, GON_E_REFUSED, "the laser is %.400s", why.text);
}

static void send(struct arming *a, enum note_kind kind, const char *name, const char *text,
                 double for_s, uint64_t ticket)
{
    struct note *n = note_new(kind);
    n->ticket = ticket;
    n->name = note_text(name);
    n->text = note_text(text);
    n->for_s = for_s;
    note_post(a->to_runner, n);
}

void arming_start(struct arming *a, const char *by)
{
    if (a->rule->arm == BENCH_ARM_RUN)
        send(a, NOTE_EXTEND, by, "by a command that starts light", bench_s(a), 0);
}

void arming_arm(struct arming *a, const char *name, const char *reason, double for_s,
                uint64_t ticket)
{
    send(a, NOTE_ARM, name, reason, for_s > 0 ? for_s : bench_s(a), ticket);
}

void arming_disarm(struct arming *a, const char *why, uint64_t ticket)
{
    send(a, NOTE_DISARM, NULL, why, 0, ticket);
}

void arming_align(struct arming *a, const char *by, double power_w, double for_s, uint64_t ticket)
{
    struct note *n = note_new(NOTE_ALIGN);
    n->ticket = ticket;
    n->name = note_text(by);
    n->power_w = power_w;
    n->for_s = for_s;
    note_post(a->to_runner, n);
}

static bool align_told(struct arming *a, const struct align *align)
{
    const bool news = align && align->changes != a->align.changes;
    if (news)
        a->align = *align;
    return news;
}

bool arming_told(struct arming *a, const struct note *n)
{
    const struct arm *arm = n->thing;
    if (n->letter.kind == NOTE_ALIGNED)
        return align_told(a, n->thing);
    const bool news = arm && arm->changes != a->seen.changes;
    if (news)
        a->seen = *arm;
    return news;
}
