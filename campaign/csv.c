// SPDX-License-Identifier: MIT
#include "campaign/csv.h"

#include "base/options.h"
#include "campaign/csv_decimal.h"

#include <errno.h>
#include <fcntl.h>
#include <locale.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MOST_COLUMNS = 500 };

struct csv {
    char *name, *text;
    const char *first, *next, *end; // first: behind the header
    long line, header_line;         // line: of the row
    struct csv_field *fields;
    char **columns; // NULL-ended
    int count;
    locale_t c_locale;
};

// --- reading -------------------------------------------------------------------------------------

static int slurp(int fd, const char *path, char **ret_text, size_t *ret_size, struct gon_error *err)
{
    size_t size = 0, room = 1 << 16;
    char *text = malloc(room);
    for (ssize_t n = 1; text && n > 0;) {
        if (size == room) {
            char *larger = realloc(text, room *= 2);
            if (!larger)
                free(text);
            text = larger;
            continue;
        }
        n = read(fd, text + size, room - size);
        if (n < 0 && errno == EINTR)
            n = 1;
        else if (n < 0) {
            free(text);
            return gon_fail(err, GON_E_INPUT, "%s: %s", path, strerror(errno));
        } else
            size += (size_t)n;
    }
    if (!text)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", path);
    *ret_text = text;
    *ret_size = size;
    return GON_OK;
}

int csv_open(const char *path, struct csv **ret_csv, struct gon_error *err)
{
    char *text = NULL;
    size_t size = 0;
    const bool standard = !strcmp(path, "-");
    const char *name = standard ? "standard input" : path;
    int fd = standard ? STDIN_FILENO : open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return gon_fail(err, GON_E_INPUT, "%s: %s", path, strerror(errno));
    int rc = slurp(fd, name, &text, &size, err);
    if (!standard)
        close(fd);
    if (rc < 0)
        return rc;
    rc = csv_parse(text, size, name, ret_csv, err);
    free(text);
    return rc;
}

// --- rows ----------------------------------------------------------------------------------------

static bool blank(char c)
{
    return c == ' ' || c == '\t';
}

static struct csv_field trimmed(const char *from, const char *to)
{
    while (from < to && blank(*from))
        from++;
    while (to > from && blank(to[-1]))
        to--;
    if (to - from >= 2 && *from == '"' && to[-1] == '"') {
        from++;
        to--;
    }
    return (struct csv_field){from, (size_t)(to - from)};
}

// The next line that is neither blank nor a comment, without its end; false at the end of the file.
static bool next_line(struct csv *c, const char **ret_from, const char **ret_to)
{
    while (c->next < c->end) {
        const char *from = c->next, *newline = memchr(from, '\n', (size_t)(c->end - from));
        const char *to = newline ? newline : c->end;
        c->next = newline ? newline + 1 : c->end;
        c->line++;
        if (to > from && to[-1] == '\r')
            to--;
        const struct csv_field all = trimmed(from, to);
        if (all.size == 0 || *all.text == '#')
            continue;
        *ret_from = from;
        *ret_to = to;
        return true;
    }
    return false;
}

// Splits into at most most fields; returns how many there are.
static int split(const char *from, const char *to, struct csv_field *fields, int most)
{
    for (int n = 0;; n++) {
        const char *at = from;
        while (at < to && blank(*at))
            at++;
        if (at < to && *at == '"') // a comma between quotes does not separate
            for (at++; at < to && *at != '"'; at++)
                ;
        while (at < to && *at != ',')
            at++;
        if (n < most)
            fields[n] = trimmed(from, at);
        if (at >= to)
            return n + 1;
        from = at + 1;
    }
}

// "campaign: {", "name = x;" or a group's name alone; a column may be called "f (T=20)".
static bool looks_like_configuration(const char *from, const char *to, int fields)
{
    const size_t size = (size_t)(to - from);
    const struct csv_field all = trimmed(from, to);
    const char last = all.text[all.size - 1];
    return memchr(from, '{', size) ||
           (memchr(from, '=', size) && (last == ';' || last == '(' || fields == 1)) ||
           (fields == 1 && last == ':');
}

static int header(struct csv *c, struct gon_error *err)
{
    const char *from, *to;
    struct csv_field names[MOST_COLUMNS];
    if (!next_line(c, &from, &to))
        return gon_fail(err, GON_E_INPUT, "%s:%ld: empty; the first line must name the columns",
                        c->name, c->line + 1);
    int n = split(from, to, names, MOST_COLUMNS);
    if (n > MOST_COLUMNS)
        return gon_fail(err, GON_E_INPUT, "%s:%ld: %d columns; at most %d", c->name, c->line, n,
                        MOST_COLUMNS);
    if (looks_like_configuration(from, to, n))
        return gon_fail(err, GON_E_INPUT,
                        "%s:%ld: this is no table but looks like a configuration; the first line "
                        "must name the columns",
                        c->name, c->line);
    const char *cr = memchr(from, '\r', (size_t)(to - from));
    if (cr)
        return gon_fail(
            err, GON_E_INPUT,
            "%s:%ld: a line ends with a carriage return alone; end lines with LF or CRLF", c->name,
            c->line);
    if (n == 1 &&
        (memchr(from, ';', (size_t)(to - from)) || memchr(from, '\t', (size_t)(to - from))))
        return gon_fail(
            err, GON_E_INPUT,
            "%s:%ld: fields are separated by ';' or tabs; use commas, and decimal points in "
            "numbers",
            c->name, c->line);
    c->columns = calloc((size_t)n + 1, sizeof *c->columns);
    c->fields = calloc((size_t)n, sizeof *c->fields);
    if (!c->columns || !c->fields)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", c->name);
    for (; c->count < n; c->count++)
        if (!(c->columns[c->count] = strndup(names[c->count].text, names[c->count].size)))
            return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", c->name);
    c->first = c->next;
    c->header_line = c->line;
    return GON_OK;
}

int csv_parse(const char *text, size_t size, const char *name, struct csv **ret_csv,
              struct gon_error *err)
{
    struct csv *c = calloc(1, sizeof *c);
    int rc = GON_OK;
    if (!c || !(c->name = strdup(name)) || !(c->text = malloc(size + 1)) ||
        !(c->c_locale = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0))) {
        csv_close(c);
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", name);
    }
    memcpy(c->text, text, size);
    c->text[size] = 0;
    c->next = c->text + (size >= 3 && !memcmp(text, "\xef\xbb\xbf", 3) ? 3 : 0);
    c->end = c->text + size;
    if (memchr(text, 0, size))
        rc = gon_fail(err, GON_E_INPUT, "%s: not a text file (it contains a zero byte)", name);
    if (rc >= 0)
        rc = header(c, err);
    if (rc < 0)
        csv_close(c);
    else
        *ret_csv = c;
    return rc;
}

void csv_close(struct csv *c)
{
    if (!c)
        return;
    for (int i = 0; i < c->count; i++)
        free(c->columns[i]);
    free(c->columns);
    free(c->fields);
    free(c->text);
    free(c->name);
    if (c->c_locale)
        freelocale(c->c_locale);
    free(c);
}

int csv_next(struct csv *c, struct gon_error *err)
{
    const char *from, *to;
    if (!next_line(c, &from, &to))
        return 0;
    int n = split(from, to, c->fields, c->count);
    if (n != c->count)
        return gon_fail(err, GON_E_INPUT, "%s:%ld: %d fields where the header names %d%s", c->name,
                        c->line, n, c->count,
                        n > c->count ? " (a decimal comma? numbers have a decimal point)" : "");
    return 1;
}

void csv_rewind(struct csv *c)
{
    c->next = c->first;
    c->line = c->header_line;
}

long csv_line(const struct csv *c)
{
    return c->line;
}

// --- columns -------------------------------------------------------------------------------------

// At most `most` bytes of a file's text for a message: what a terminal would obey becomes '?', in
// ASCII and in UTF-8 (U+0080 to U+009F); so does what is left of a character that was cut.
static const char *shown(struct csv_field f, size_t most, char text[CSV_SHOWN])
{
    size_t used = 0;
    bool cut = f.size > most;
    for (size_t i = 0; i < f.size && i < most && used < 120; i++) {
        unsigned char c = (unsigned char)f.text[i],
                      next = i + 1 < f.size ? (unsigned char)f.text[i + 1] : 0;
        bool stray = c >= 0x80 && c < 0xc0 && (i == 0 || (unsigned char)f.text[i - 1] < 0x80);
        bool control = c < 0x20 || c == 0x7f || (c == 0xc2 && next >= 0x80 && next < 0xa0) || stray;
        text[used++] = control ? '?' : (char)c;
        i += c == 0xc2 && control;
    }
    while (cut && used > 0 && ((unsigned char)text[used - 1] & 0xc0) == 0x80)
        used--;
    if (cut && used > 0 && (unsigned char)text[used - 1] >= 0xc0)
        used--;
    strcpy(text + used, cut ? "..." : "");
    return text;
}

const char *csv_shown(const char *name, size_t most, char text[CSV_SHOWN])
{
    return shown((struct csv_field){name, strlen(name)}, most, text);
}

int csv_column(const struct csv *c, const char *name)
{
    int found = -1;
    for (int i = 0; i < c->count; i++)
        if (!strcmp(c->columns[i], name))
            found = found == -1 ? i : -2;
    return found;
}

const char *const *csv_columns(const struct csv *c)
{
    return (const char *const *)c->columns;
}

// A file may have these for themselves: one of them is no misspelling of another.
static bool has_a_meaning(const char *name)
{
    static const char *const known[] = {"theta_i_deg", "theta_r_deg", "theta_r_signed_deg",
                                        "dphi_deg",    "f_r",         "u_f_r"};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (!strcmp(name, known[i]))
            return true;
    return false;
}

static const char *misspelled(const struct csv *c, const char *name)
{
    const char *words[MOST_COLUMNS + 1];
    int count = 0;
    for (int i = 0; i < c->count; i++)
        if (!has_a_meaning(c->columns[i]))
            words[count++] = c->columns[i];
    words[count] = NULL;
    return options_suggest(name, words);
}

// typed: a person gave the name, which may be wrong; otherwise the column's name is.
static int no_column(const struct csv *c, const char *name, bool typed, struct gon_error *err)
{
    char all[300] = "", text[CSV_SHOWN];
    if (csv_column(c, name) == -2)
        return gon_fail(err, GON_E_INPUT, "%s:%ld: column '%s' is there twice", c->name,
                        c->header_line, name);
    const char *meant = misspelled(c, name);
    if (meant)
        return gon_fail(err, GON_E_INPUT, "%s:%ld: no column '%s'%s '%s'%s", c->name,
                        c->header_line, name, typed ? "; did you mean" : "; rename",
                        csv_shown(meant, 60, text), typed ? "?" : " to it");
    for (int i = 0; i < c->count; i++) {
        size_t used = strlen(all);
        snprintf(all + used, sizeof all - used, "%s%s", i ? ", " : "",
                 csv_shown(c->columns[i], 40, text));
    }
    return gon_fail(err, GON_E_INPUT, "%s:%ld: no column '%s'; there are %s", c->name,
                    c->header_line, name, all);
}

int csv_no_column(const struct csv *c, const char *name, struct gon_error *err)
{
    return no_column(c, name, false, err);
}

int csv_need(const struct csv *c, const char *name, int *ret_column, struct gon_error *err)
{
    const int column = csv_column(c, name);
    if (column < 0)
        return no_column(c, name, false, err);
    *ret_column = column;
    return GON_OK;
}

int csv_choose(const struct csv *c, const char *name, int *ret_column, struct gon_error *err)
{
    const int column = csv_column(c, name);
    if (column < 0)
        return no_column(c, name, true, err);
    *ret_column = column;
    return GON_OK;
}

// --- fields --------------------------------------------------------------------------------------

struct csv_field csv_text(const struct csv *c, int column)
{
    return c->fields[column];
}

int csv_fail(const struct csv *c, int column, struct gon_error *err, const char *fmt, ...)
{
    char text[200];
    const struct csv_field f = c->fields[column];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    char name[128], value[128];
    return gon_fail(err, GON_E_INPUT, "%s:%ld: %s = %s: %s", c->name, c->line,
                    csv_shown(c->columns[column], 60, name), shown(f, 40, value), text);
}

int csv_real(const struct csv *c, int column, double *ret_value, struct gon_error *err)
{
    const struct csv_field f = c->fields[column];
    double value;
    if (f.size == 0)
        return csv_fail(c, column, err, "an empty field; leave the row out or give a number");
    if (!csv_decimal(f.text, f.size, c->c_locale, &value))
        return csv_fail(c, column, err, "not a number");
    if (!isfinite(value))
        return csv_fail(c, column, err, "too large");
    *ret_value = value;
    return GON_OK;
}
