// SPDX-License-Identifier: MIT
#include "tests/dst/matrix.h"

#include <string.h>

enum { READINGS = 24, VARIANTS = 2, SEED = 7 };

enum verdict { AS_LISTED, NOTHING_TO_SEE, OTHERWISE, BROKEN };

struct cell {
    bool done;
    char letter; // the reaction seen
    enum verdict verdict;
    int struck; // faults that were done
    char text[WATCH_TEXT + 400];
};

// What came out, as one letter: the strongest of what was seen.
static char letter_of(const struct trial_result *r)
{
    const struct trial_seen *s = &r->seen;
    return s->warned      ? 'w'
           : s->operators ? 'p'
           : s->homings   ? 'h'
           : s->flagged   ? 'x'
           : s->returns   ? 'r'
                          : '.';
}

// Pauses and stops that the state itself is made of.
static void take_own_away(struct trial_seen *s, enum trial_moment m, const struct fault *f)
{
    s->operators -= m == MOMENT_PAUSED && s->operators > 0;
    s->operators -= f->reaction == REACT_WARNS && f->mend && s->operators > 0; // that asked for OFF
    if (f->reaction != REACT_STOPS)
        s->stops = 0;
    if (m <= MOMENT_PREPARING || m == MOMENT_STOPPING)
        s->homings = f->reaction == REACT_HOMES ? s->homings : 0;
}

static bool is_as_listed(const struct fault *f, const struct trial_seen *s)
{
    switch (f->reaction) {
    case REACT_GOES_ON:
    case REACT_RETURNS: return s->operators == 0;
    case REACT_REPEATS: return s->operators == 0 && s->flagged > 0;
    case REACT_HOMES: return s->operators == 0 && s->homings > 0;
    case REACT_PAUSES: return s->operators > 0 && (!f->words || s->told);
    case REACT_WARNS: return s->warned;
    case REACT_STOPS: return s->stops > 0;
    default: return false;
    }
}

// Where a fault cannot show: the light is off anyway, no reading is under way, or it is over before
// anybody looks.
static bool may_show_nothing(const struct fault *f, enum trial_moment m)
{
    const bool dark = m <= MOMENT_PREPARING || m >= MOMENT_PAUSED;
    if (f->reaction == REACT_REPEATS)
        return m != MOMENT_SETTLING && m != MOMENT_SAMPLING;
    if (f->reaction == REACT_PAUSES && !f->mend && (m == MOMENT_IDLE || m >= MOMENT_PAUSED))
        return true;
    if (f->needs & NEEDS_LIGHT && dark && (!f->mend || f->hold_s > 0))
        return true;
    return f->reaction == REACT_HOMES && m <= MOMENT_PREPARING;
}

static void describe(struct cell *c, const struct trial_result *r)
{
    const struct trial_seen *s = &r->seen;
    snprintf(c->text, sizeof c->text,
             "%d pauses for an operator, %d that ended by themselves, %d flagged, %d "
             "homings%s%.200s%s%s",
             s->operators, s->returns, s->flagged, s->homings, *s->reason ? "; " : "", s->reason,
             r->violations ? "; BROKEN " : "", r->violations ? r->text : "");
}

static void judge(struct cell *c, const struct fault *f, enum trial_moment m,
                  struct trial_result *r)
{
    enum verdict v;
    if (!r->seen.begun)
        return;
    c->struck += r->faults;
    take_own_away(&r->seen, m, f);
    const char letter = letter_of(r);
    if (r->violations || r->state != RUN_DONE)
        v = BROKEN;
    else if (is_as_listed(f, &r->seen))
        v = AS_LISTED;
    else
        v = may_show_nothing(f, m) && r->seen.operators == 0 ? NOTHING_TO_SEE : OTHERWISE;
    if (c->done && v <= c->verdict)
        return;
    c->done = true;
    c->verdict = v;
    c->letter = letter;
    describe(c, r);
}

static void run_cell(struct cell *c, const char *profiles, int fault, enum trial_moment m)
{
    for (int v = 0; v < VARIANTS; v++) {
        const struct fault *f = &faults[fault];
        struct rig_spec rig;
        struct trial_result r;
        rig_draw(&rig, (uint64_t)(SEED + fault * 64 + (int)m * 4 + v));
        if (f->needs & (NEEDS_TCP | NEEDS_SERIAL))
            rig.tcp[f->line] = f->needs & NEEDS_TCP;
        if (f->needs & NEEDS_AZ)
            rig.controller = BENCH_AZ;
        const struct trial_spec spec = {.seed = rig.seed,
                                        .readings = READINGS,
                                        .profiles = profiles,
                                        .rig = &rig,
                                        .fault = fault,
                                        .moment = m,
                                        .variant = 1 + v * 31 + fault};
        trial_run(&spec, &r);
        judge(c, f, m, &r);
    }
}

static char mark(const struct cell *c)
{
    return !c->done                       ? '?'
           : c->verdict == BROKEN         ? '#'
           : c->verdict == OTHERWISE      ? '!'
           : c->verdict == NOTHING_TO_SEE ? '-'
                                          : ' ';
}

// A row that the product does not react to as listed must say so, and only such a row.
static int report_row(const struct cell *row, const struct fault *f, FILE *out)
{
    int bad = 0, otherwise = 0, broken = 0;
    fprintf(out, "%-4s%-33s%-9s", f->id, f->what, reaction_names[f->reaction]);
    for (int m = 0; m < MOMENTS; m++) {
        fprintf(out, "%7d%c%c", row[m].struck, row[m].done ? row[m].letter : ' ', mark(&row[m]));
        otherwise += row[m].verdict == OTHERWISE;
        broken += row[m].verdict == BROKEN || !row[m].done;
    }
    fprintf(out, "%s\n", f->not_yet ? "  not yet" : "");
    if (f->matrix_only)
        broken = 0; // it stores wrong values, which is what it says
    bad = f->not_yet ? broken : broken + otherwise;
    if (f->not_yet && !otherwise && !broken && !f->matrix_only) {
        fprintf(out, "    it does what is listed now: take its not_yet away\n");
        bad++;
    }
    return bad;
}

static void explain(struct cell (*cells)[MOMENTS], FILE *out)
{
    fprintf(
        out,
        "\nfaults done, and the reaction seen: . goes on, r returns by itself, x flagged and read "
        "again,\nh homed again, p paused for an operator, w warned of the light; - nothing to "
        "be seen,\n! not what is listed, # a rule was broken, ? could not be done\n\nnot yet:\n");
    for (int i = 0; i < faults_count(); i++)
        if (faults[i].not_yet)
            fprintf(out, "  %-4s %s: %s\n", faults[i].id, faults[i].what, faults[i].not_yet);
    fprintf(out, "elsewhere:\n");
    for (const struct fault_elsewhere *e = faults_elsewhere; e->ids; e++)
        fprintf(out, "  %s: %s\n", e->ids, e->why);
    for (int i = 0; i < faults_count(); i++)
        for (int m = 0; m < MOMENTS; m++)
            if (cells[i][m].verdict >= OTHERWISE)
                fprintf(out, "%s %s, %s, while %s: %s\n",
                        faults[i].not_yet ? "not yet:" : "FAILED:", faults[i].id, faults[i].what,
                        trial_moment_names[m], cells[i][m].text);
}

int matrix_run(const char *profiles, int only, FILE *out)
{
    static struct cell cells[TRIAL_FAULTS][MOMENTS];
    int bad = 0;
    fprintf(out, "%-46s", "fault and listed reaction");
    for (int m = 0; m < MOMENTS; m++)
        fprintf(out, "%9s", trial_moment_names[m]);
    fprintf(out, "\n");
    for (int i = 0; i < faults_count(); i++) {
        if (only >= 0 && i != only)
            continue;
        for (int m = 0; m < MOMENTS; m++)
            run_cell(&cells[i][m], profiles, i, (enum trial_moment)m);
        bad += report_row(cells[i], &faults[i], out);
        fflush(out);
    }
    explain(cells, out);
    return bad;
}
