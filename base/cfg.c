// SPDX-License-Identifier: MIT
#include "base/cfg.h"
#include "base/cfg_file.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MOST_BYTES = 1 << 20, STRING_SHOWN = 40 };

static void say(struct cfg_sink sink, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

static void say(struct cfg_sink sink, const char *fmt, ...)
{
    char line[1200];
    va_list args;
    va_start(args, fmt);
    vsnprintf(line, sizeof line, fmt, args);
    va_end(args);
    if (sink.say)
        sink.say(sink.ctx, line);
}

int cfg_say(struct cfg_file *f, int line, const char *fmt, ...)
{
    char text[1000];
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    say(f->sink, "%s:%d: %s", f->name, line, text);
    return 1;
}

int cfg_line(const config_setting_t *s)
{
    int line = 0;
    for (; s && line < 1; s = config_setting_parent(s))
        line = (int)config_setting_source_line(s);
    return line > 0 ? line : 1;
}

static const char *skip(const char *p);

// libconfig keeps the low half of a hexadecimal number: the one with that half, from the setting's
// line on, is what was written.
static void show_hex(const struct cfg_file *f, const config_setting_t *s, char *text, size_t size)
{
    const uint32_t half = (uint32_t)config_setting_get_int64(s);
    const char *p = f->text;
    for (int line = 1; *p && line < cfg_line(s); p++)
        line += *p == '\n';
    while (*p) {
        const char *end = skip(p);
        if (end == p && p[0] == '0' && (p[1] == 'x' || p[1] == 'X')) {
            end = p + 2 + strspn(p + 2, "0123456789abcdefABCDEF");
            if ((uint32_t)strtoull(p, NULL, 16) == half) {
                snprintf(text, size, "%.*s", (int)(end - p), p);
                return;
            }
        }
        p = end > p ? end : p + 1;
    }
    snprintf(text, size, "0x%" PRIx32, half);
}

// Its first characters in quotes; terminators of lines as they are written in a file, so that they
// end no line of a message.
static void show_string(const char *string, char *text, size_t size)
{
    static const char controls[] = "\r\n\t\f", letters[] = "rntf";
    size_t used = 0;
    int shown = 0;
    text[used++] = '"';
    for (; string[shown] && shown < STRING_SHOWN && used + 9 < size; shown++) {
        const unsigned char c = (unsigned char)string[shown];
        const char *control = strchr(controls, c);
        if (control)
            used += (size_t)snprintf(text + used, size - used, "\\%c", letters[control - controls]);
        else
            used += (size_t)snprintf(text + used, size - used,
                                     c < 0x20 || c == 0x7f ? "\\x%02x" : "%c", c);
    }
    snprintf(text + used, size - used, "%s\"", string[shown] ? "..." : "");
}

void cfg_show(const struct cfg_file *f, const config_setting_t *s, char *text, size_t size)
{
    if (config_setting_get_format(s) == CONFIG_FORMAT_HEX) {
        show_hex(f, s, text, size);
        return;
    }
    switch (config_setting_type(s)) {
    case CONFIG_TYPE_INT:
    case CONFIG_TYPE_INT64:
        snprintf(text, size, "%lld", config_setting_get_int64(s));
        break;
    case CONFIG_TYPE_FLOAT:
        snprintf(text, size, "%.9g", config_setting_get_float(s));
        break;
    case CONFIG_TYPE_BOOL:
        snprintf(text, size, "%s", config_setting_get_bool(s) ? "true" : "false");
        break;
    case CONFIG_TYPE_STRING:
        show_string(config_setting_get_string(s), text, size);
        break;
    case CONFIG_TYPE_GROUP:
        snprintf(text, size, "{ ... }");
        break;
    case CONFIG_TYPE_ARRAY:
        snprintf(text, size, "[ ... ]");
        break;
    case CONFIG_TYPE_LIST:
        snprintf(text, size, "( ... )");
        break;
    default:
        snprintf(text, size, "%s", "");
        break;
    }
}

// --- reading -------------------------------------------------------------------------------------

static char *slurp(int fd, size_t size)
{
    char *text = calloc(1, size + 1);
    size_t have = 0;
    while (text && have < size) {
        ssize_t n = read(fd, text + have, size - have);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            break;
        have += (size_t)n;
    }
    return text;
}

// The file's content, or NULL when the sink was told why not. O_NONBLOCK: opening a FIFO must not
// hang.
static char *read_file(const char *path, struct cfg_sink sink)
{
    char *text = NULL;
    struct stat st;
    int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
    if (fd < 0 || fstat(fd, &st) < 0) {
        say(sink, "%s: %s", path, strerror(errno));
    } else if (!S_ISREG(st.st_mode)) {
        say(sink, "%s: not a regular file", path);
    } else if (st.st_size > MOST_BYTES) {
        say(sink, "%s: %lld bytes; a configuration has at most %d", path, (long long)st.st_size,
            MOST_BYTES);
    } else if (!(text = slurp(fd, (size_t)st.st_size))) {
        say(sink, "%s: out of memory", path);
    } else if (strlen(text) < (size_t)st.st_size) {
        say(sink, "%s: not a text file (it contains a zero byte or changed while it was read)",
            path);
        free(text);
        text = NULL;
    }
    if (fd >= 0)
        close(fd);
    return text;
}

struct cfg_file *cfg_open(const char *path, struct cfg_sink sink)
{
    char *text = read_file(path, sink);
    struct cfg_file *f = text ? cfg_parse(text, path, sink) : NULL;
    free(text);
    return f;
}

// --- parsing -------------------------------------------------------------------------------------

// libconfig takes the directive at the start of a line only, after blanks. The line's number, or 0.
static int include_line(const char *text)
{
    for (int line = 1; *text; line++) {
        text += strspn(text, " \t");
        if (!strncmp(text, "@include", 8))
            return line;
        text += strcspn(text, "\n");
        text += *text == '\n';
    }
    return 0;
}

// Where a text, a comment or a name that begins at p ends; p itself when none does.
static const char *skip(const char *p)
{
    if (*p == '"') {
        for (p++; *p && *p != '"'; p++)
            p += *p == '\\' && p[1];
        return p + (*p == '"');
    }
    if (*p == '#' || (p[0] == '/' && p[1] == '/'))
        return p + strcspn(p, "\n");
    if (p[0] == '/' && p[1] == '*') {
        const char *end = strstr(p + 2, "*/");
        return end ? end + 2 : p + strlen(p);
    }
    while (isalpha((unsigned char)*p) || *p == '_' || *p == '*')
        for (p++; isdigit((unsigned char)*p) || *p == '-';)
            p++;
    return p;
}

// libconfig cuts a whole number to 32 bits without a word. The first such number, or NULL.
static const char *too_large(const char *text)
{
    static const char digits[] = "0123456789";
    for (const char *p = text; *p;) {
        const char *end = skip(p);
        size_t length = strspn(p, digits);
        if (end > p) {
            p = end;
        } else if (length == 0) {
            p++;
        } else if (p[length] && strchr(".eExXL", p[length])) {
            p += strspn(p, "0123456789abcdefABCDEFxXL.+-");
        } else if (length > 10 || strtoll(p, NULL, 10) > INT_MAX) {
            return p;
        } else {
            p += length;
        }
    }
    return NULL;
}

static int line_of(const char *text, const char *at)
{
    int line = 1;
    for (; text < at; text++)
        line += *text == '\n';
    return line;
}

static const char *parse_hint(const char *error)
{
    if (strstr(error, "mismatched"))
        return "; [ ] holds numbers of one kind: write ( ) instead";
    if (strstr(error, "syntax"))
        return "; look for a missing ';', quote or bracket here or on the line before";
    return "";
}

static int parse(struct cfg_file *f)
{
    static const char bom[] = "\xef\xbb\xbf";
    const char *start = f->text + (strncmp(f->text, bom, 3) ? 0 : 3);
    int include = include_line(start);
    if (include)
        return cfg_say(f, include, "@include is not allowed: a configuration is one file");
    const char *large = too_large(start);
    if (large)
        return cfg_say(f, line_of(start, large), "%.*s: too large for a whole number",
                       (int)strspn(large, "0123456789"), large);
    size_t size = strlen(start);
    char *lines = malloc(size + 2); // a comment on the last line needs its newline
    if (!lines)
        return cfg_say(f, 1, "out of memory");
    memcpy(lines, start, size);
    memcpy(lines + size, "\n", 2);
    int ok = config_read_string(&f->tree, lines);
    free(lines);
    if (ok)
        return 0;
    const char *error = config_error_text(&f->tree);
    return cfg_say(f, config_error_line(&f->tree), "%s%s", error, parse_hint(error));
}

struct cfg_file *cfg_parse(const char *text, const char *name, struct cfg_sink sink)
{
    struct cfg_file *f = calloc(1, sizeof *f);
    if (!f) {
        say(sink, "%s: out of memory", name);
        return NULL;
    }
    config_init(&f->tree);
    f->sink = sink;
    f->text = strdup(text);
    f->name = strdup(name);
    if (f->text && f->name && parse(f) == 0)
        return f;
    cfg_close(f);
    return NULL;
}

void cfg_close(struct cfg_file *f)
{
    if (!f)
        return;
    config_destroy(&f->tree);
    free(f->text);
    free(f->name);
    free(f);
}

const char *cfg_text(const struct cfg_file *f)
{
    return f->text;
}

// --- complaints of others ------------------------------------------------------------------------

static config_setting_t *child(config_setting_t *s, const char *word, size_t length)
{
    char name[CFG_PATH];
    if (!config_setting_is_group(s) || length >= sizeof name)
        return NULL;
    memcpy(name, word, length);
    name[length] = 0;
    return config_setting_get_member(s, name);
}

// The setting at "a.b[1].c", or the nearest ancestor that is in the file.
static config_setting_t *find(struct cfg_file *f, const char *path, bool *ret_exact)
{
    config_setting_t *s = config_root_setting(&f->tree);
    while (*path) {
        size_t length = strcspn(path, ".[");
        config_setting_t *next;
        if (*path == '[') {
            char *end;
            unsigned long index = strtoul(path + 1, &end, 10);
            next =
                config_setting_is_aggregate(s) ? config_setting_get_elem(s, (unsigned)index) : NULL;
            path = end + (*end == ']');
        } else {
            next = child(s, path, length);
            path += length;
        }
        path += *path == '.';
        if (!next) {
            *ret_exact = false;
            return s;
        }
        s = next;
    }
    *ret_exact = true;
    return s;
}

int cfg_complain(struct cfg_file *f, const char *path, const char *fmt, ...)
{
    char text[700], value[CFG_VALUE] = "";
    bool exact;
    const config_setting_t *s = find(f, path, &exact);
    va_list args;
    va_start(args, fmt);
    vsnprintf(text, sizeof text, fmt, args);
    va_end(args);
    if (exact)
        cfg_show(f, s, value, sizeof value);
    return cfg_say(f, cfg_line(s), "%s%s%s: %s", path, *value ? " = " : "", value, text);
}
