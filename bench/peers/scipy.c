// SPDX-License-Identifier: MIT
#include "bench/peers/scipy.h"

#include "bench/peers/score.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

// Debian's modules belong to Debian's interpreter.
#define SCRIPT "/usr/bin/python3 bench/peers/scipy_de.py"
enum { FORMS = 3, GONIO_SEEDS = 5 };

struct form {
    const char *name, *arguments;
};

static const struct form forms[FORMS] = {
    {"scipy DE, 5 parameters, defaults", "full 15 0.01"},
    {"scipy DE, projected, defaults", "projected 15 0.01"},
    {"scipy DE, projected, tol 1e-6", "projected 15 1e-6"},
};

static bool run_script(const char *path, uint64_t seed, const struct form *form, struct score *s,
                       double best)
{
    char command[256];
    double ms, delta, evaluations;
    snprintf(command, sizeof command, SCRIPT " %s %d %s", path, (int)seed, form->arguments);
    FILE *out = popen(command, "r");
    if (!out)
        return false;
    int got = fscanf(out, "%lf %lf %lf", &ms, &delta, &evaluations);
    if (pclose(out) != 0 || got != 3)
        return false;
    s->ms[s->count++] = ms;
    s->hits += delta <= best * (1 + 1e-6);
    s->passes += evaluations;
    return true;
}

static bool measure(const struct task *task, int tasks, const char *path, struct score *gonio,
                    struct score *score)
{
    for (int i = 0; i < tasks; i++) {
        if (!task_write(&task[i], path))
            return false;
        for (int f = 0; f < FORMS; f++) {
            if (!run_script(path, task[i].seed, &forms[f], &score[f], task[i].best))
                return false;
            for (int seed = 1; seed <= GONIO_SEEDS; seed++)
                score_attempt(gonio, &task[i], (uint64_t)seed, false);
        }
    }
    return true;
}

bool scipy_compare(const struct task *task, int tasks)
{
    char path[] = "/tmp/gonio-peers-XXXXXX";
    struct setting setting[FORMS + 1] = {{.name = NULL}}, stop[SETTINGS_MAX];
    struct score score[FORMS + 1];
    settings_to_stop(stop);
    setting[FORMS] = stop[0];
    bool ok = true;
    for (int f = 0; f <= FORMS; f++) {
        if (f < FORMS)
            setting[f].name = forms[f].name;
        ok = score_new(&score[f], &setting[f], tasks * (f < FORMS ? 1 : FORMS * GONIO_SEEDS)) && ok;
    }
    int file = mkstemp(path);
    ok = ok && file >= 0;
    if (!ok)
        return false;
    close(file);
    bool measured = measure(task, tasks, path, &score[FORMS], score);
    unlink(path);
    double gonio_ms = score_quantile(&score[FORMS], 0.5);
    score_title("scipy", tasks, task->seed, 1);
    for (int f = FORMS; f >= 0; f--) {
        score[f].count = measured || f == FORMS ? score[f].count : 0;
        score_report("scipy", &score[f], gonio_ms);
    }
    score_summary("scipy, 5 parameters", score, 1, 0, gonio_ms, 300);
    for (int f = 0; f <= FORMS; f++)
        score_free(&score[f]);
    return true;
}
