// SPDX-License-Identifier: MIT
// What is done to wires.
#include "tests/dst/faults_inside.h"

#include <errno.h>

static struct line *bus(struct trial *t)
{
    return &t->rig.line[RIG_BUS];
}

// The laser's or the detector's.
static struct line *text_line(struct trial *t, int variant)
{
    return &t->rig.line[variant & 1 ? RIG_LASER : RIG_DETECTOR];
}

static int64_t late_ns(int variant)
{
    return OS_MS(20 + variant % 60 * 50);
}

void fault_lose(struct trial *t, int v)
{
    line_disturb(bus(t), v % 5 ? LINE_LOST : LINE_DEAF, 1 + v % 3);
}

void fault_lose_many(struct trial *t, int v)
{
    (void)v;
    line_disturb(bus(t), LINE_LOST, 12);
}

void fault_flip(struct trial *t, int v)
{
    line_disturb(bus(t), LINE_FLIPPED, 1 + v % 2);
}

void fault_wrong_header(struct trial *t, int v)
{
    line_disturb(bus(t), v % 2 ? LINE_WRONG_UNIT : LINE_WRONG_FUNCTION, 1);
}

void fault_late(struct trial *t, int v)
{
    bus(t)->late_ns = late_ns(v);
    line_disturb(bus(t), v % 3 ? LINE_LATE : LINE_DOUBLED, 1);
}

static void mangle(struct line *l, int v)
{
    static const enum line_fault ways[] = {LINE_CUT, LINE_SPLIT, LINE_BEFORE, LINE_AFTER,
                                           LINE_MERGED};
    line_disturb(l, ways[v % 5], 1);
}

void fault_mangle_bus(struct trial *t, int v)
{
    mangle(bus(t), v);
}

void fault_break_bus(struct trial *t, int v)
{
    line_pull(bus(t), v % 2 ? ECONNRESET : 0, false);
}

void fault_hole(struct trial *t, int v)
{
    (void)v;
    bus(t)->hole = true;
}

void fault_fill(struct trial *t)
{
    line_plug(bus(t));
}

void fault_stale_number(struct trial *t, int v)
{
    (void)v;
    line_disturb(bus(t), LINE_STALE_NUMBER, 1);
}

void fault_wrong_echo(struct trial *t, int v)
{
    (void)v;
    line_disturb(bus(t), LINE_WRONG_ECHO, 1);
}

void fault_text_noise(struct trial *t, int v)
{
    line_disturb(text_line(t, v), v & 2 ? LINE_BEFORE : LINE_AFTER, 1);
}

void fault_text_cut(struct trial *t, int v)
{
    line_disturb(text_line(t, v), v & 2 ? LINE_CUT : LINE_LOST, 1);
}

void fault_text_late(struct trial *t, int v)
{
    text_line(t, v)->late_ns = OS_MS(20 + v % 60 * 5);
    line_disturb(text_line(t, v), LINE_LATE, 1);
}

void fault_text_very_late(struct trial *t, int v)
{
    text_line(t, v)->late_ns = OS_MS(500 + v % 50 * 50);
    line_disturb(text_line(t, v), LINE_LATE, 1);
}

void fault_text_doubled(struct trial *t, int v)
{
    text_line(t, v)->late_ns = OS_MS(20 + v % 2 * 100);
    line_disturb(text_line(t, v), LINE_DOUBLED, 1);
}

void fault_text_split(struct trial *t, int v)
{
    line_disturb(text_line(t, v), v & 2 ? LINE_SPLIT : LINE_MERGED, 1);
}

void fault_endless(struct trial *t, int v)
{
    line_disturb(text_line(t, v), LINE_ENDLESS, 1);
}

void fault_echo_on(struct trial *t, int v)
{
    (void)v;
    t->rig.bench.laser.echo = true;
}

void fault_echo_off(struct trial *t)
{
    t->rig.bench.laser.echo = false;
}

void fault_comma(struct trial *t, int v)
{
    (void)v;
    line_disturb(&t->rig.line[RIG_DETECTOR], LINE_COMMA, 1);
}

void fault_no_number(struct trial *t, int v)
{
    static const char *const answers[] = {"nan",    "inf",     "-INF", "OVLD",
                                          "9.9E37", "9.91E37", "1.2 V"};
    t->rig.line[RIG_DETECTOR].number = answers[v % 7];
    line_disturb(&t->rig.line[RIG_DETECTOR], LINE_NO_NUMBER, 1);
}

void fault_unplug(struct trial *t, int v)
{
    line_pull(&t->rig.line[v % RIG_LINES], v % 2 ? EIO : ENODEV, true);
}

void fault_plug(struct trial *t)
{
    for (int i = 0; i < RIG_LINES; i++)
        if (t->rig.line[i].away)
            line_plug(&t->rig.line[i]);
}
