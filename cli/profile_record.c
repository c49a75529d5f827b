// SPDX-License-Identifier: MIT
#include "cli/profile_record.h"

#include "base/cancel.h"
#include "base/clk.h"
#include "cli/interrupt.h"
#include "cli/out.h"
#include "cli/profile_check.h"
#include "cli/verb.h"
#include "drivers/golden_text.h"
#include "drivers/recorder.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum { STEPS_MOST = 64 };

struct options {
    long unit;
    const char *out, *set, *run; // of the last two each may be given several times
    bool interactive;
};

static const struct option_row rows[] = {
    {"--unit", OPTION_INT, offsetof(struct options, unit), "N", 1, 247,
     "Modbus address of the instrument; else 1"},
    {"--out", OPTION_TEXT, offsetof(struct options, out), "PATH", 0, 0,
     "a new file for the entries; else standard output"},
    {"--set", OPTION_TEXT, offsetof(struct options, set), "NAME=VALUE", 0, 0,
     "afterwards set this value, and record that, too; may be repeated"},
    {"--do", OPTION_TEXT, offsetof(struct options, run), "NAME", 0, 0,
     "afterwards do what has this name, an exchange or a write, also if it moves something; "
     "'NAME: a = 1, b = 2' gives it values; may be repeated"},
    {"--interactive", OPTION_FLAG, offsetof(struct options, interactive), NULL, 0, 0,
     "instead of asking everything run lines from standard input"},
    VERB_OPTIONS_END};

static const struct verb verb = {
    "profile record",
    "PROFILE LINK",
    "a session with an instrument as golden entries",
    "Opens LINK (serial:..., tcp:..., usbtmc:..., modbus-rtu:..., modbus-tcp:...) with the code "
    "that talks to instruments, asks who it is and everything that the profile can ask, and writes "
    "every exchange, byte by byte, as entries for the profile's golden list.\n",
    rows,
    NULL};

// --- writing -------------------------------------------------------------------------------------

struct record {
    const struct profile *p;
    FILE *out, *notes; // notes: comments until it is known whether an entry follows
    char *note;        // of notes
    size_t note_size;
    const char *link;
    bool into_list; // the profile has a golden list: what is written is pasted into it
    int entries;
};

static void spill_notes(struct record *r)
{
    fflush(r->notes);
    fwrite(r->note, 1, r->note_size, r->out);
    rewind(r->notes);
    fflush(r->notes);
}

// Entries are written as soon as they are known, so that nothing is lost with the program.
static void take(void *ctx, const struct profile_golden *g, const char *comment)
{
    struct record *r = ctx;
    const int room = PROFILE_GOLDEN - r->p->golden_count;
    if (*comment)
        fprintf(r->notes, "  # %s\n", comment);
    if (g && r->entries == room)
        fprintf(r->notes, "  # a profile holds %d entries: leave some out\n", PROFILE_GOLDEN);
    if (g && r->entries > 0 && !r->into_list)
        fprintf(r->out, ",\n");
    if (g || r->into_list)
        spill_notes(r);
    if (g) {
        golden_text_print(r->out, g, r->p->protocol == PROFILE_MODBUS);
        fprintf(r->out, "%s", r->into_list ? ",\n" : "");
        r->entries++;
    }
    fflush(r->out);
}

static void write_head(struct record *r)
{
    const time_t now = (time_t)(clk_utc_ns(clk_system()) / CLK_S(1));
    struct tm utc;
    char when[40];
    gmtime_r(&now, &utc);
    strftime(when, sizeof when, "%Y-%m-%d %H:%M:%S UTC", &utc);
    fprintf(r->out, "# Recorded %s with gonio %s over %s.\n", when, GONIO_VERSION, r->link);
    if (r->into_list)
        fprintf(r->out, "# To be pasted into profile %s, right behind \"golden: (\".\n",
                r->p->name);
    else
        fprintf(r->out, "# To be pasted at the end of profile %s.\ngolden: (\n", r->p->name);
}

static void write_end(struct record *r)
{
    if (!r->into_list && r->entries > 0)
        fprintf(r->out, "\n");
    spill_notes(r);
    if (!r->into_list)
        fprintf(r->out, ");\n");
    fflush(r->out);
}

// A recording is never written over.
static FILE *open_out(const char *path)
{
    FILE *out = path ? fopen(path, "wxe") : stdout;
    if (!out)
        out_say("profile record: %s: %s", path,
                errno == EEXIST ? "is there; a recording is only written to a new file"
                                : strerror(errno));
    return out;
}

// --- Ctrl-C --------------------------------------------------------------------------------------

// The clock gets its turn at least every 50 ms of waiting for an instrument, and looks there.
struct watching_clk {
    struct clk clk;
    const struct interrupt *interrupt;
    struct cancel *cancel;
};

static int64_t watching_now(const struct clk *clk)
{
    (void)clk;
    return clk_now_ns(clk_system());
}

static int64_t watching_utc(const struct clk *clk)
{
    (void)clk;
    return clk_utc_ns(clk_system());
}

static void watching_sleep(struct clk *clk, int64_t t_ns, const struct cancel *cancel)
{
    const struct watching_clk *w = (const struct watching_clk *)clk;
    const int64_t left_ns = t_ns - clk_now_ns(clk_system());
    const int wait_ms = left_ns > CLK_MS(1) ? (int)(left_ns / CLK_MS(1)) : 0;
    if (cancel && w->interrupt->fd >= 0 && interrupt_came(w->interrupt, wait_ms))
        cancel_request(w->cancel);
    clk_sleep_until(clk_system(), t_ns, cancel);
    if (w->interrupt->fd >= 0 && interrupt_came(w->interrupt, 0))
        cancel_request(w->cancel);
}

// --- what is done --------------------------------------------------------------------------------

static int worse(int status, int other)
{
    return status == EXIT_OK || other == EXIT_INTERRUPTED ? other : status;
}

// What the steps of one line were worth.
static int tell(int rc, const struct gon_error *err)
{
    if (rc == GON_E_CANCELED)
        return EXIT_INTERRUPTED;
    if (rc < 0)
        out_say("profile record: %s", err->text);
    return rc == GON_E_INPUT ? EXIT_INPUT : rc < 0 ? EXIT_FAILED : EXIT_OK;
}

static bool is_over(int rc)
{
    return rc == GON_E_GONE || rc == GON_E_CANCELED;
}

static int do_line(struct record *r, struct recorder *recorder, const char *line, int *status)
{
    struct gon_error err;
    const int before = r->entries;
    int rc = recorder_may(r->p, line, &err);
    if (rc == GON_E_REFUSED) {
        out_say("profile record: %s", err.text);
        *status = worse(*status, EXIT_REFUSED);
        return rc;
    }
    if (rc == 0)
        rc = recorder_do(recorder, line, &err);
    *status = worse(*status, tell(rc, &err));
    if (r->entries > before)
        fprintf(stderr, "%s: %d %s\n", line, r->entries - before,
                r->entries == before + 1 ? "entry" : "entries");
    return rc;
}

// A line of standard input; false: its end, Ctrl-C, or it cannot be read. Read without stdio, so
// that waiting can be interrupted. *ret_used is its length, or size when it does not fit.
static bool next_line(const struct interrupt *i, char *ret_line, size_t size, size_t *ret_used,
                      int *status)
{
    size_t used = 0;
    for (;;) {
        struct pollfd p[2] = {{STDIN_FILENO, POLLIN, 0}, {i->fd, POLLIN, 0}};
        char c;
        if (poll(p, 2, -1) < 0 && errno != EINTR)
            return false;
        if (p[1].revents)
            return false;
        if (!p[0].revents)
            continue;
        const ssize_t n = read(STDIN_FILENO, &c, 1);
        if (n < 0 && errno != EINTR && errno != EAGAIN) {
            out_say("profile record: standard input: %s", strerror(errno));
            *status = worse(*status, EXIT_INPUT);
            return false;
        }
        if (n == 0 || (n > 0 && c == '\n')) {
            ret_line[used < size ? used : size - 1] = 0;
            *ret_used = used;
            return n > 0 || used > 0;
        }
        if (n > 0 && c != '\r' && used < size)
            ret_line[used++] = c;
    }
}

// Whether a line was read as a whole: it must not be done in part.
static bool is_whole(const char *line, size_t used, size_t size, int *status)
{
    const char *what = used == size           ? "longer than 511 bytes"
                       : strlen(line) != used ? "it has a zero byte"
                                              : NULL;
    if (!what)
        return true;
    out_say("profile record: '%.40s...': %s; nothing is done for it", line, what);
    *status = worse(*status, EXIT_INPUT);
    return false;
}

static void run_lines(struct record *r, struct recorder *recorder, const struct interrupt *i,
                      int *status)
{
    char line[512];
    size_t used;
    const bool asks = isatty(STDIN_FILENO) && isatty(STDERR_FILENO);
    for (;;) {
        if (asks)
            fprintf(stderr, "%s> ", r->p->name);
        if (!next_line(i, line, sizeof line, &used, status))
            break;
        const char *text = line + strspn(line, " \t");
        if (*text == '#' || !is_whole(line, used, sizeof line, status))
            continue;
        if (*text && is_over(do_line(r, recorder, text, status)))
            return;
    }
    if (i->fd >= 0 && interrupt_came(i, 0))
        *status = EXIT_INTERRUPTED;
}

static void run_session(struct record *r, struct recorder *recorder, const struct options *o,
                        const char *const *steps, int count, const struct interrupt *i, int *status)
{
    struct gon_error err = {0};
    char who[400];
    int rc = recorder_identify(recorder, who, sizeof who, &err);
    *status = worse(*status, tell(rc, &err));
    if (rc == 0)
        fprintf(stderr, "%s: %s\n", r->link, who);
    if (o->interactive && !is_over(rc))
        run_lines(r, recorder, i, status);
    if (o->interactive)
        return;
    // What is a question to one instrument may be a command to another.
    if (rc < 0) {
        if (!is_over(rc))
            out_say("profile record: it is not known who that is, so nothing else is asked; "
                    "--interactive asks whatever is wanted");
        return;
    }
    rc = recorder_ask_all(recorder, &err);
    if (rc > 0)
        out_say("profile record: %d of the questions failed; the last: %s", rc, err.text);
    *status = worse(*status, rc > 0 ? EXIT_FAILED : tell(rc, &err));
    for (int k = 0; k < count && !is_over(rc); k++)
        rc = do_line(r, recorder, steps[k], status);
}

static int record_with(struct record *r, const struct options *o, const char *const *steps,
                       int count, const struct interrupt *i)
{
    static const struct clk_ops ops = {watching_now, watching_utc, watching_sleep};
    struct cancel *cancel = cancel_new();
    struct watching_clk clk = {{&ops}, i, cancel};
    struct recorder *recorder = NULL;
    struct gon_error err;
    int status = EXIT_OK;
    if (!cancel) {
        out_say("profile record: out of memory");
        return EXIT_FAILED;
    }
    int rc = recorder_open(r->p, r->link, (int)o->unit, &clk.clk, cancel,
                           (struct recorder_sink){take, r}, &recorder, &err);
    if (rc < 0) {
        out_fail(&err);
        status = rc == GON_E_INPUT ? EXIT_INPUT : rc == GON_E_REFUSED ? EXIT_REFUSED : EXIT_FAILED;
    } else if (!(r->out = open_out(o->out))) {
        status = EXIT_INPUT;
    } else {
        write_head(r);
        run_session(r, recorder, o, steps, count, i, &status);
        write_end(r);
        fprintf(stderr, "%d %s\n", r->entries, r->entries == 1 ? "entry" : "entries");
    }
    recorder_close(recorder);
    cancel_free(cancel);
    return status;
}

// --- the word ------------------------------------------------------------------------------------

// --set and --do, which may be given several times: taken out of the arguments, in their order.
static int take_steps(int *argc, char **argv, const char **steps)
{
    static const char *const names[] = {"--set", "--do"};
    int kept = 0, count = 0;
    for (int i = 0; i < *argc; i++) {
        const char *value = NULL;
        for (size_t k = 0; k < 2 && !value; k++) {
            const size_t size = strlen(names[k]);
            if (strcmp(argv[i], names[k]) == 0)
                value = i + 1 < *argc ? argv[++i] : "";
            else if (strncmp(argv[i], names[k], size) == 0 && argv[i][size] == '=')
                value = argv[i] + size + 1;
        }
        if (!value)
            argv[kept++] = argv[i];
        else if (count < STEPS_MOST)
            steps[count++] = value;
        else
            return -1;
    }
    *argc = kept;
    return count;
}

// All of them before anything is sent.
static int check_steps(const struct profile *p, const char *const *steps, int count)
{
    struct gon_error err;
    for (int i = 0; i < count; i++)
        if (recorder_may(p, steps[i], &err) < 0)
            return out_fail(&err);
    return EXIT_OK;
}

static int record(struct record *r, const struct options *o, const char *const *steps, int count)
{
    struct interrupt i;
    r->notes = open_memstream(&r->note, &r->note_size);
    int status = EXIT_FAILED;
    if (r->notes) {
        interrupt_open(&i);
        status = record_with(r, o, steps, count, &i);
        interrupt_close(&i);
        fclose(r->notes);
        free(r->note);
    }
    if (o->out && r->out && (ferror(r->out) | fclose(r->out))) {
        out_say("profile record: %s: %s", o->out, strerror(errno));
        status = worse(status, EXIT_FAILED);
    }
    return status;
}

int profile_record(int argc, char **argv)
{
    struct options o = {.unit = 1};
    const char *operands[2], *steps[STEPS_MOST];
    char path[PATH_MAX];
    const int count = take_steps(&argc, argv, steps);
    if (count < 0) {
        out_say("profile record: at most %d of --set and --do", STEPS_MOST);
        return EXIT_INPUT;
    }
    if (verb_take(&verb, argc, argv, &o, operands, 2, 2) < 0)
        return EXIT_INPUT;
    if (o.interactive && count > 0) {
        out_say("profile record: --interactive takes its lines from standard input; without --set "
                "and --do");
        return EXIT_INPUT;
    }
    struct profile *p = profile_take(operands[0], path, sizeof path);
    if (!p)
        return EXIT_INPUT;
    int status = check_steps(p, steps, count);
    struct record r = {.p = p, .link = operands[1], .into_list = p->golden_count > 0};
    if (status == EXIT_OK)
        status = record(&r, &o, steps, count);
    free(p);
    return out_finish(status);
}
