// SPDX-License-Identifier: MIT
#include "cli/out.h"

#include "cli/verb.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <sys/ioctl.h>
#include <unistd.h>

bool out_is_terminal(FILE *out)
{
    return isatty(fileno(out));
}

bool out_colour(FILE *out)
{
    const char *no = getenv("NO_COLOR");
    return out_is_terminal(out) && !(no && *no);
}

int out_columns(FILE *out)
{
    struct winsize w;
    return ioctl(fileno(out), TIOCGWINSZ, &w) == 0 && w.ws_col > 0 ? w.ws_col : 80;
}

const char *out_begin(FILE *out, enum out_style style)
{
    static const char *const codes[] = {"",         "\033[1m",  "\033[2m",
                                        "\033[31m", "\033[32m", "\033[33m"};
    return out_colour(out) ? codes[style] : "";
}

const char *out_end(FILE *out)
{
    return out_colour(out) ? "\033[0m" : "";
}

__attribute__((format(printf, 3, 0))) static void say(const char *begin, enum out_style style,
                                                      const char *fmt, va_list ap)
{
    char text[2000];
    vsnprintf(text, sizeof text, fmt, ap);
    fprintf(stderr, "%s%s%s%s\n", out_begin(stderr, style), begin, out_end(stderr), text);
}

void out_say(const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    say("gonio: ", OUT_PLAIN, fmt, ap);
    va_end(ap);
}

void out_warn(const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    say("warning: ", OUT_YELLOW, fmt, ap);
    va_end(ap);
}

void out_local(int64_t ms, char *text, size_t size)
{
    time_t s = (time_t)(ms / 1000);
    struct tm tm;
    *text = 0;
    if (ms > 0 && localtime_r(&s, &tm))
        strftime(text, size, "%Y-%m-%d %H:%M", &tm);
}

void out_value(char *text, size_t size, double value, double u)
{
    if (!isfinite(u) || u <= 0 || u > 1e6) {
        snprintf(text, size, "%.4g", value);
        return;
    }
    int decimals = (int)fmin(9, fmax(0, -floor(log10(u))));
    snprintf(text, size, "%.*f ±%.*f", decimals, value, decimals, u);
}

void out_duration(char *text, size_t size, double s)
{
    if (s < 100)
        snprintf(text, size, "%.0f s", s);
    else if (s < 6000)
        snprintf(text, size, "%.0f min", s / 60);
    else
        snprintf(text, size, "%.0f h %02.0f min", floor(s / 3600), floor(fmod(s, 3600) / 60));
}

int out_fail(const struct gon_error *err)
{
    fprintf(stderr, "%sgonio:%s %s\n", out_begin(stderr, OUT_RED), out_end(stderr), err->text);
    switch (err->code) {
    case GON_E_INPUT: return EXIT_INPUT;
    case GON_E_GONE: return EXIT_NO_DAEMON;
    case GON_E_REFUSED: return EXIT_REFUSED;
    case GON_E_CANCELED: return EXIT_INTERRUPTED;
    default: return EXIT_FAILED;
    }
}

void out_json(const json_t *o)
{
    json_dumpf(o, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(17));
    putchar('\n');
}

json_t *out_json_text(const char *text)
{
    json_t *o = json_string(text);
    char *copy = o ? NULL : strdup(text);
    for (char *c = copy; c && *c; c++)
        if ((unsigned char)*c >= 0x80)
            *c = '?';
    if (copy)
        o = json_string(copy);
    free(copy);
    return o ? o : json_null();
}

void out_json_line(const json_t *o)
{
    json_dumpf(o, stdout, JSON_COMPACT | JSON_REAL_PRECISION(17));
    putchar('\n');
    fflush(stdout);
}

// Why writing failed; 0: it did not. When it was long ago, errno has meanwhile been somebody
// else's: one more byte, of an output that is incomplete anyway, tells it again.
static int write_error(void)
{
    if (fflush(stdout) != 0)
        return errno;
    if (!ferror(stdout))
        return 0;
    return write(fileno(stdout), "\n", 1) < 0 ? errno : EIO;
}

int out_finish(int status)
{
    const int error = write_error();
    if (error == 0 || error == EPIPE) // a reader that has seen enough is no failure of ours
        return status;
    fprintf(stderr, "gonio: standard output: %s\n", strerror(error));
    return EXIT_FAILED;
}

// --- tables -------------------------------------------------------------------------------------

struct table {
    int columns;
    size_t count, room;
    char **cells;
    bool *right;
};

static void *must(void *p)
{
    if (p)
        return p;
    fprintf(stderr, "gonio: out of memory\n");
    exit(EXIT_FAILED);
}

struct table *table_new(int columns)
{
    struct table *t = must(calloc(1, sizeof *t));
    t->columns = columns;
    t->right = must(calloc((size_t)columns, sizeof *t->right));
    return t;
}

void table_right(struct table *t, int column)
{
    t->right[column] = true;
}

void table_cell(struct table *t, const char *fmt, ...)
{
    va_list ap;
    if (t->count == t->room) {
        t->room = t->room ? 2 * t->room : 64;
        t->cells = must(realloc(t->cells, t->room * sizeof *t->cells));
    }
    char *text = NULL;
    va_start(ap, fmt);
    int n = vasprintf(&text, fmt, ap);
    va_end(ap);
    t->cells[t->count++] = must(n < 0 ? NULL : text);
}

static int width(const char *text) // characters, as all of ours are one column wide
{
    int n = 0;
    for (; *text; text++)
        n += (*text & 0xc0) != 0x80;
    return n;
}

static void print_row(const struct table *t, size_t row, const int *widths, FILE *out)
{
    bool terminal = widths != NULL, heading = row == 0;
    fputs(terminal && heading ? out_begin(out, OUT_BOLD) : "", out);
    for (int c = 0; c < t->columns; c++) {
        const char *text = t->cells[row * (size_t)t->columns + (size_t)c];
        int pad = terminal ? widths[c] - width(text) : 0;
        bool last = c == t->columns - 1;
        if (c)
            fputs(terminal ? "  " : "\t", out);
        fprintf(out, "%*s%s", t->right[c] ? pad : 0, "", text);
        fprintf(out, "%*s", t->right[c] || last ? 0 : pad, "");
    }
    fprintf(out, "%s\n", terminal && heading ? out_end(out) : "");
}

void table_print(struct table *t, FILE *out)
{
    int *widths = NULL;
    if (out_is_terminal(out)) {
        widths = must(calloc((size_t)t->columns, sizeof *widths));
        for (size_t i = 0; i < t->count; i++) {
            int *w = &widths[i % (size_t)t->columns], n = width(t->cells[i]);
            *w = n > *w ? n : *w;
        }
    }
    for (size_t row = 0; row < t->count / (size_t)t->columns; row++)
        print_row(t, row, widths, out);
    for (size_t i = 0; i < t->count; i++)
        free(t->cells[i]);
    free(t->cells);
    free(t->right);
    free(widths);
    free(t);
}
