// SPDX-License-Identifier: MIT
#include "drivers/message.h"

#include "drivers/checksum.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LINE_MOST 4096
#define COMMAND_MOST 256
#define CHECKSUM_MOST 16 // digits and what stands before them
#define TRIES 3
#define WRITE_NS CLK_MS(200) // for a command to leave
#define DELAY_NS CLK_MS(20) // a command may reach the device so much later than we think (USB, TCP)

struct message {
    struct transport *t;
    const struct message_format *format;
    bool out_of_step;
    bool stray;       // a command's answer may still come that nobody wants
    bool ends;        // where the device says what a message is: it also sends the terminator
    int64_t ready_ns; // the next command not before
    size_t have;
    char in[LINE_MOST];
};

struct message *message_new(struct transport *t, const struct message_format *format)
{
    struct message *m = calloc(1, sizeof *m);
    if (!m) {
        transport_close(t);
        return NULL;
    }
    m->t = t;
    m->format = format;
    m->ready_ns = clk_now_ns(transport_clk(t));
    return m;
}

void message_free(struct message *m)
{
    if (!m)
        return;
    transport_close(m->t);
    free(m);
}

struct transport *message_transport(const struct message *m)
{
    return m->t;
}

const struct link_stats *message_stats(const struct message *m)
{
    return transport_stats(m->t);
}

int message_out_of_step(struct message *m, const char *why)
{
    (void)why; // the caller's text says it; here it documents the call
    m->out_of_step = true;
    transport_book(m->t)->errors[LINK_GARBLED]++;
    return GON_E_LINK;
}

void message_refused(struct message *m)
{
    transport_book(m->t)->errors[LINK_REFUSED]++;
}

// Bytes as a person can read them: what is not printable as \xNN.
static const char *readable(const char *bytes, size_t size, char *out, size_t out_size)
{
    size_t used = 0;
    for (size_t i = 0; i < size && used + 5 < out_size; i++) {
        unsigned char c = (unsigned char)bytes[i];
        used += (size_t)snprintf(out + used, out_size - used,
                                 c >= 0x20 && c < 0x7f ? "%c" : "\\x%02x", c);
    }
    out[used] = 0;
    return out;
}

static int garbled(struct message *m, const char *command, const char *what, size_t size,
                   struct gon_error *err)
{
    char shown[120];
    message_out_of_step(m, what);
    return gon_fail(err, GON_E_LINK, "%s: '%s': %s: '%s'", transport_link(m->t), command, what,
                    readable(m->in, size, shown, sizeof shown));
}

// --- sending -------------------------------------------------------------------------------------

static int put(struct message *m, const char *command, struct gon_error *err)
{
    const struct message_format *f = m->format;
    char line[COMMAND_MOST];
    size_t size = strlen(command);
    assert(size + strlen(f->end_out) + CHECKSUM_MOST < sizeof line);
    memcpy(line, command, size + 1);
    int rc = f->checksum ? checksum_append(f->checksum, line, size, sizeof line, &size, err) : 0;
    if (rc < 0)
        return rc;
    memcpy(line + size, f->end_out, strlen(f->end_out));
    size += strlen(f->end_out);
    struct clk *clk = transport_clk(m->t);
    rc = transport_write(m->t, line, size, clk_now_ns(clk) + WRITE_NS, err);
    m->ready_ns = clk_now_ns(clk) + f->min_gap_ns; // its answer will put it right
    if (f->min_gap_ns > 0)
        m->ready_ns += DELAY_NS;
    if (rc == GON_E_LINK || rc == GON_E_CANCELED) // half a command may have left
        m->out_of_step = true;
    return rc;
}

int message_send_blind(struct message *m, const char *command, bool at_once, struct gon_error *err)
{
    const struct cancel *cancel = transport_mind(m->t, NULL);
    if (!at_once)
        clk_sleep_until(transport_clk(m->t), m->ready_ns, NULL);
    int rc = put(m, command, err);
    transport_mind(m->t, cancel);
    m->stray = true;
    return rc;
}

static int wait_gap(struct message *m, struct gon_error *err)
{
    if (clk_sleep_until(transport_clk(m->t), m->ready_ns, transport_cancel(m->t)) < 0)
        return gon_fail(err, GON_E_CANCELED, "%s: stopped before a command", transport_link(m->t));
    return 0;
}

// --- one question --------------------------------------------------------------------------------

// A part of m->in.
struct span {
    size_t begin, end;
};

// Where the line ends: at its terminator; where the device says when its message is over, not
// before that, and then without one too.
static char *find_end(struct message *m, size_t from)
{
    if (transport_framed(m->t) && !transport_ended(m->t))
        return NULL;
    size_t length = strlen(m->format->end_in);
    char *end = m->have < from + length
                    ? NULL
                    : memmem(m->in + from, m->have - from, m->format->end_in, length);
    return !end && transport_framed(m->t) ? m->in + m->have : end;
}

// Reads on until the line that begins at from is complete.
static int take_line(struct message *m, const char *command, size_t from, int64_t deadline_ns,
                     struct span *ret_line, struct gon_error *err)
{
    char *end;
    while (!(end = find_end(m, from))) {
        if (m->have == sizeof m->in)
            return garbled(m, command, "4096 bytes without an end", 40, err);
        int rc = transport_read(m->t, m->in + m->have, sizeof m->in - m->have, deadline_ns, err);
        if (rc == GON_E_LINK && clk_now_ns(transport_clk(m->t)) < deadline_ns) {
            message_out_of_step(m, "the link says what was wrong");
            gon_prefix(err, "'%s'", command);
            return rc;
        }
        if (rc == GON_E_LINK && m->have > 0)
            return garbled(m, command, "the answer breaks off", m->have, err);
        if (rc == GON_E_LINK) {
            transport_book(m->t)->errors[LINK_SILENT]++;
            gon_fail(err, rc, "%s: '%s': no answer in %.0f ms", transport_link(m->t), command,
                     (double)m->format->timeout_ns * 1e-6);
        }
        if (rc < 0) {
            m->out_of_step = true;
            return rc;
        }
        m->have += (size_t)rc;
    }
    m->ready_ns = clk_now_ns(transport_clk(m->t)) + m->format->min_gap_ns;
    if (transport_framed(m->t) && end == m->in + m->have && m->ends)
        return garbled(m, command, "the answer breaks off", m->have, err);
    m->ends = transport_framed(m->t) && end < m->in + m->have;
    *ret_line = (struct span){from, (size_t)(end - m->in)};
    return 0;
}

static void trim_begin(const struct message *m, struct span *s)
{
    while (s->begin < s->end && m->in[s->begin] && strchr(" \t\r\n", m->in[s->begin]))
        s->begin++;
}

static void trim_end(const struct message *m, struct span *s)
{
    while (s->end > s->begin && m->in[s->end - 1] && strchr(" \t\r", m->in[s->end - 1]))
        s->end--;
}

static bool is_text(const struct message *m, const struct span *s, const char *text)
{
    return s->end - s->begin == strlen(text) && memcmp(m->in + s->begin, text, strlen(text)) == 0;
}

static bool given(const char *text)
{
    return text && *text;
}

static bool stands_alone(const struct message *m, const struct span *s)
{
    char line[COMMAND_MOST];
    if (!m->format->alone || s->end - s->begin >= sizeof line)
        return false;
    memcpy(line, m->in + s->begin, s->end - s->begin);
    line[s->end - s->begin] = 0;
    return m->format->alone(m->format->ctx, line);
}

// The line that says OK: instead of an answer, or behind it.
static int take_ok(struct message *m, const char *command, int64_t deadline_ns, struct span *answer,
                   size_t *ret_used, struct gon_error *err)
{
    const size_t end_size = strlen(m->format->end_in);
    struct span line = *answer;
    trim_begin(m, &line);
    trim_end(m, &line);
    if (is_text(m, &line, m->format->ok_line)) {
        answer->begin = answer->end;
        return 0;
    }
    if (stands_alone(m, &line))
        return 0;
    int rc = take_line(m, command, answer->end + end_size, deadline_ns, &line, err);
    if (rc < 0)
        return rc;
    *ret_used = line.end + end_size;
    trim_begin(m, &line);
    trim_end(m, &line);
    return is_text(m, &line, m->format->ok_line)
               ? 0
               : garbled(m, command, "a second line that does not say OK", m->have, err);
}

// Behind the command as the device repeats it; the answer may be missing.
static int cut_echo(struct message *m, const char *command, struct span *answer,
                    struct gon_error *err)
{
    const size_t length = strlen(command), end_size = strlen(m->format->echo_end);
    const char *text = m->in + answer->begin;
    const size_t size = answer->end - answer->begin;
    if (size < length || memcmp(text, command, length) != 0 ||
        (size > length &&
         (size < length + end_size || memcmp(text + length, m->format->echo_end, end_size) != 0)))
        return garbled(m, command, "the device does not repeat the command", answer->end, err);
    answer->begin += size > length ? length + end_size : length;
    return 0;
}

static bool is_printable(const char *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++)
        if ((unsigned char)bytes[i] < 0x20 || (unsigned char)bytes[i] > 0x7e)
            return false;
    return true;
}

static int unwanted_echo(struct message *m, const char *command, struct gon_error *err)
{
    m->out_of_step = true; // the real answer follows
    transport_book(m->t)->errors[LINK_ECHO]++;
    return gon_fail(err, GON_E_DEVICE, "%s: sends back the command '%s'; turn its echo off",
                    transport_link(m->t), command);
}

// Cuts off what is not the answer itself.
static int unwrap(struct message *m, const char *command, struct span *a, struct gon_error *err)
{
    const struct message_format *f = m->format;
    trim_begin(m, a);
    int rc = given(f->echo_end) ? cut_echo(m, command, a, err) : 0;
    if (rc == 0 && f->checksum && a->end > a->begin) {
        size_t size;
        struct gon_error why;
        if (checksum_take(f->checksum, m->in + a->begin, a->end - a->begin, &size, &why) < 0)
            return garbled(m, command, why.text, a->end, err);
        a->end = a->begin + size;
    }
    if (rc == 0)
        trim_begin(m, a);
    trim_end(m, a);
    return rc;
}

// The answer: one and no more, readable, not the command itself, and not empty where that could not
// be told from a stray terminator.
static int take_answer(struct message *m, const char *command, char *ret_answer, size_t size,
                       struct gon_error *err)
{
    const struct message_format *f = m->format;
    const int64_t deadline_ns = clk_now_ns(transport_clk(m->t)) + f->timeout_ns;
    struct span a;
    m->have = 0;
    int rc = take_line(m, command, 0, deadline_ns, &a, err);
    size_t used = rc < 0 ? 0 : a.end + strlen(f->end_in);
    if (rc == 0 && given(f->ok_line))
        rc = take_ok(m, command, deadline_ns, &a, &used, err);
    if (rc == 0)
        rc = unwrap(m, command, &a, err);
    if (rc < 0)
        return rc;
    if (!given(f->echo_end) && is_text(m, &a, command))
        return unwanted_echo(m, command, err);
    if (m->have > used)
        return garbled(m, command, "two answers to one question", m->have, err);
    if (a.begin == a.end && !f->empty && !given(f->echo_end) && !given(f->ok_line))
        return garbled(m, command, "an empty answer", a.end, err);
    if (!is_printable(m->in + a.begin, a.end - a.begin))
        return garbled(m, command, "unreadable bytes in the answer (wrong baud rate?)", a.end, err);
    if (a.end - a.begin >= size)
        return garbled(m, command, "the answer is too long", a.end, err);
    memcpy(ret_answer, m->in + a.begin, a.end - a.begin);
    ret_answer[a.end - a.begin] = 0;
    return 0;
}

static int exchange(struct message *m, const char *command, char *ret_answer, size_t size,
                    struct gon_error *err)
{
    struct link_stats *book = transport_book(m->t);
    int rc = wait_gap(m, err);
    if (rc == 0)
        rc = transport_drain(m->t, 0, err);
    if (rc < 0)
        return rc;
    book->errors[LINK_STRAY] += rc > 0 && !m->stray;
    m->stray = false;
    rc = put(m, command, err);
    if (rc < 0)
        return rc;
    book->requests++;
    const int64_t sent_ns = clk_now_ns(transport_clk(m->t));
    rc = take_answer(m, command, ret_answer, size, err);
    if (rc == 0)
        link_stats_answer(book, clk_now_ns(transport_clk(m->t)) - sent_ns);
    return rc;
}

static int get_into_step(struct message *m, struct gon_error *err)
{
    const struct message_format *f = m->format;
    char answer[COMMAND_MOST];
    transport_book(m->t)->resyncs++;
    int rc = transport_drain(m->t, f->quiet_ns, err);
    if (rc < 0)
        return rc;
    if (f->sync_query) {
        rc = exchange(m, f->sync_query, answer, sizeof answer, err);
        if (rc < 0)
            return rc;
        if (strncmp(answer, f->sync_begins, strlen(f->sync_begins)) != 0)
            return garbled(m, f->sync_query, "not the answer that gets into step", m->have, err);
    }
    m->out_of_step = false;
    return 0;
}

int message_query(struct message *m, const char *command, char *ret_answer, size_t size,
                  struct gon_error *err)
{
    int rc = m->out_of_step ? get_into_step(m, err) : 0;
    return rc < 0 ? rc : exchange(m, command, ret_answer, size, err);
}

int message_send(struct message *m, const char *command, struct gon_error *err)
{
    int rc = m->out_of_step ? get_into_step(m, err) : 0;
    if (rc == 0)
        rc = wait_gap(m, err);
    return rc < 0 ? rc : put(m, command, err);
}

int message_reopen(struct message *m, struct gon_error *err)
{
    int rc = transport_reopen(m->t, err);
    if (rc < 0)
        return rc;
    m->ready_ns = clk_now_ns(transport_clk(m->t));
    m->out_of_step = true;
    m->ends = false;
    return 0;
}

// --- questions that may be repeated --------------------------------------------------------------

int message_ask(struct message *m, const char *command,
                int (*read)(const char *answer, void *ctx, struct gon_error *err), void *ctx,
                struct gon_error *err)
{
    char answer[COMMAND_MOST];
    struct gon_error why = {0};
    int rc = GON_E_LINK;
    for (int i = 0; i < TRIES && rc == GON_E_LINK; i++) {
        transport_book(m->t)->retries += i > 0;
        rc = message_query(m, command, answer, sizeof answer, &why);
        if (rc == 0 && read(answer, ctx, &why)) {
            rc = message_out_of_step(m, "not what was asked");
            gon_fail(&why, rc, "%s: '%s' was answered '%.80s'", transport_link(m->t), command,
                     answer);
        }
    }
    return rc < 0 ? gon_fail(err, rc, "%s", why.text) : 0;
}

static int read_number(const char *answer, void *ctx, struct gon_error *err)
{
    return message_number(answer, ctx, err);
}

int message_ask_number(struct message *m, const char *command, double *ret_value,
                       struct gon_error *err)
{
    return message_ask(m, command, read_number, ret_value, err);
}

struct text {
    char *to;
    size_t size;
};

static int read_text(const char *answer, void *ctx, struct gon_error *err)
{
    const struct text *text = ctx;
    (void)err;
    snprintf(text->to, text->size, "%s", answer);
    return 0;
}

int message_ask_text(struct message *m, const char *command, char *ret_text, size_t size,
                     struct gon_error *err)
{
    return message_ask(m, command, read_text, &(struct text){ret_text, size}, err);
}
