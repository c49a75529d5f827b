// SPDX-License-Identifier: MIT
// uses: drivers sim model base
#include "drivers/message.h"

#include "drivers/checksum.h"
#include "tests/unit/vline.h"

#include <locale.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define MS(ms) CLK_MS(ms)

// A device that counts: "v?" is answered by how often it was asked, "id?" by its name.
static const struct message_format format = {
    .end_out = "\r",
    .end_in = "\r\n",
    .min_gap_ns = MS(5),
    .timeout_ns = MS(100),
    .quiet_ns = MS(350),
    .sync_query = "id?",
    .sync_begins = "counter",
};

static struct message *begin_as(struct scripted *s, const struct message_format *as,
                                void (*hear)(struct scripted *, const char *, int64_t),
                                const struct cancel *cancel)
{
    struct transport *t;
    struct gon_error err;
    scripted_init(s, as->end_out, hear);
    struct clk *clk = vline_begin(&s->port);
    assert_int_equal(transport_open(vline.link, clk, cancel, &t, &err), 0);
    struct message *m = message_new(t, as);
    assert_non_null(m);
    return m;
}

static struct message *begin(struct scripted *s,
                             void (*hear)(struct scripted *, const char *, int64_t),
                             const struct cancel *cancel)
{
    return begin_as(s, &format, hear, cancel);
}

static void count(struct scripted *s, const char *line, char text[64])
{
    if (strcmp(line, "id?") == 0)
        snprintf(text, 64, "counter 7\r\n");
    else
        snprintf(text, 64, "%d\r\n", ++s->step);
}

static void hear_well(struct scripted *s, const char *line, int64_t t_ns)
{
    char text[64];
    count(s, line, text);
    scripted_say(s, text, t_ns + MS(20));
}

static void answers_come_without_terminator_and_blanks(void **state)
{
    struct scripted s;
    char answer[32];
    struct gon_error err;
    (void)state;
    struct message *m = begin(&s, hear_well, NULL);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "1");
    assert_int_equal(message_stats(m)->requests, 1);
    assert_int_equal(message_stats(m)->latency_last_ns, MS(20));
    message_free(m);
}

static void the_gap_is_kept(void **state)
{
    struct scripted s;
    char answer[32];
    (void)state;
    struct message *m = begin(&s, hear_well, NULL);
    for (int i = 0; i < 3; i++)
        assert_int_equal(message_query(m, "v?", answer, sizeof answer, NULL), 0);
    assert_int_equal(message_send(m, "x", NULL), 0);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, NULL), 0);
    for (int i = 1; i < 3; i++)
        assert_int_equal(s.heard_ns[i] - s.heard_ns[i - 1], MS(25));
    assert_int_equal(s.heard_ns[4] - s.heard_ns[3], MS(25)); // it may have arrived late
    message_free(m);
}

// Every byte on its own, 7 ms apart: 70 ms in all.
static void hear_and_dribble(struct scripted *s, const char *line, int64_t t_ns)
{
    char text[64];
    count(s, line, text);
    for (size_t i = 0; text[i]; i++)
        port_send(&s->port, text + i, 1, t_ns + (int64_t)(i + 1) * MS(7));
}

static void an_answer_split_at_every_byte_is_reassembled(void **state)
{
    struct scripted s;
    char answer[32];
    (void)state;
    struct message *m = begin(&s, hear_and_dribble, NULL);
    for (int i = 0; i < 20; i++) {
        char expected[16];
        snprintf(expected, sizeof expected, "%d", i + 1);
        assert_int_equal(message_query(m, "v?", answer, sizeof answer, NULL), 0);
        assert_string_equal(answer, expected);
    }
    message_free(m);
}

static void hear_in_two_parts(struct scripted *s, const char *line, int64_t t_ns)
{
    (void)line;
    scripted_say(s, "12", t_ns + MS(1));
    scripted_say(s, "34\r", t_ns + MS(60));
    scripted_say(s, "\n", t_ns + MS(90));
}

static void a_partial_line_waits_for_its_rest(void **state)
{
    struct scripted s;
    char answer[32];
    (void)state;
    struct message *m = begin(&s, hear_in_two_parts, NULL);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, NULL), 0);
    assert_string_equal(answer, "1234");
    message_free(m);
}

// The first answer comes 200 ms after its timeout.
static void hear_late(struct scripted *s, const char *line, int64_t t_ns)
{
    char text[64];
    count(s, line, text);
    scripted_say(s, text, t_ns + (s->heard == 1 ? MS(300) : MS(10)));
}

static void a_late_answer_is_not_taken_for_the_next_ones(void **state)
{
    struct scripted s;
    char answer[32];
    struct gon_error err;
    (void)state;
    struct message *m = begin(&s, hear_late, NULL);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "'v?': no answer in 100 ms"));
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "2");
    assert_int_equal(s.heard, 3); // with the question that gets into step
    assert_int_equal(message_stats(m)->errors[LINK_SILENT], 1);
    assert_int_equal(message_stats(m)->resyncs, 1);
    assert_int_equal(message_stats(m)->requests, 3);
    assert_int_equal(link_stats_answers(message_stats(m)), 2);
    message_free(m);
}

// Twice the same at once; and an answer with another's end before it.
static void hear_double(struct scripted *s, const char *line, int64_t t_ns)
{
    char text[64];
    count(s, line, text);
    scripted_say(s, text, t_ns + MS(10));
    if (s->heard == 1)
        scripted_say(s, text, t_ns + MS(10));
    if (s->step == 3)
        scripted_say(s, text, t_ns + MS(12)); // after the answer was taken
}

static void a_doubled_answer_is_dropped(void **state)
{
    struct scripted s;
    char answer[32];
    struct gon_error err;
    (void)state;
    struct message *m = begin(&s, hear_double, NULL);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "two answers"));
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "2");
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "3");
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "4");
    assert_int_equal(message_stats(m)->errors[LINK_STRAY], 1);
    message_free(m);
}

static void hear_with_noise(struct scripted *s, const char *line, int64_t t_ns)
{
    char text[64];
    count(s, line, text);
    if (s->step == 1 && strcmp(line, "v?") == 0)
        scripted_say(s, "\xff\x80", t_ns + MS(5)); // before the answer
    scripted_say(s, text, t_ns + MS(10));
}

static void unreadable_bytes_are_no_answer(void **state)
{
    struct scripted s;
    char answer[32] = "kept";
    struct gon_error err;
    (void)state;
    struct message *m = begin(&s, hear_with_noise, NULL);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), GON_E_LINK);
    assert_string_equal(answer, "kept");
    assert_non_null(strstr(err.text, "\\xff\\x80"));
    assert_int_equal(message_stats(m)->errors[LINK_GARBLED], 1);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "2");
    message_free(m);
}

static void hear_endless(struct scripted *s, const char *line, int64_t t_ns)
{
    char text[PORT_REPLY_MOST];
    if (s->heard > 1) {
        hear_well(s, line, t_ns);
        return;
    }
    memset(text, 'x', sizeof text);
    for (int i = 0; i < 20; i++)
        port_send(&s->port, text, sizeof text, t_ns + MS(1));
}

static void a_line_without_end_is_capped(void **state)
{
    struct scripted s;
    char answer[32];
    struct gon_error err;
    (void)state;
    struct message *m = begin(&s, hear_endless, NULL);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "4096 bytes without an end"));
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "1");
    message_free(m);
}

static void hear_and_echo(struct scripted *s, const char *line, int64_t t_ns)
{
    char text[64], echo[80];
    snprintf(echo, sizeof echo, "%s\r\n", line);
    count(s, line, text);
    scripted_say(s, echo, t_ns + MS(1));
    scripted_say(s, text, t_ns + MS(10));
}

static void an_echo_is_named(void **state)
{
    struct scripted s;
    char answer[32];
    struct gon_error err;
    (void)state;
    struct message *m = begin(&s, hear_and_echo, NULL);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "turn its echo off"));
    assert_int_equal(message_stats(m)->errors[LINK_ECHO], 1);
    assert_int_equal(link_stats_failures(message_stats(m)), 1);
    message_free(m);
}

static void hear_nothing(struct scripted *s, const char *line, int64_t t_ns)
{
    (void)s;
    (void)line;
    (void)t_ns;
}

static void a_hang_up_is_no_timeout(void **state)
{
    struct scripted s;
    char answer[32];
    struct gon_error err;
    (void)state;
    struct message *m = begin(&s, hear_nothing, NULL);
    const int64_t start_ns = vline.clk.t_ns;
    vline.hangup_ns = start_ns + MS(30);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), GON_E_GONE);
    assert_int_equal(vline.clk.t_ns - start_ns, MS(30));
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), GON_E_GONE);
    assert_true(vline.waits < 10); // no spinning
    assert_int_equal(message_stats(m)->errors[LINK_SILENT], 0);
    assert_int_equal(message_stats(m)->errors[LINK_HUNG_UP], 1);
    message_free(m);
}

static void waiting_can_be_cancelled_but_not_what_must_be_said(void **state)
{
    struct scripted s;
    char answer[32];
    struct gon_error err;
    struct cancel *cancel = cancel_new();
    (void)state;
    struct message *m = begin(&s, hear_nothing, cancel);
    vline.cancel = cancel;
    vline.cancel_ns = vline.clk.t_ns + MS(40);
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), GON_E_CANCELED);
    assert_int_equal(vline.clk.t_ns, vline.cancel_ns);
    assert_int_equal(message_send(m, "x", &err), GON_E_CANCELED);
    assert_int_equal(s.heard, 1);
    assert_int_equal(message_send_blind(m, "off", true, &err), 0);
    assert_string_equal(s.last, "off");
    message_free(m);
    cancel_free(cancel);
}

static void a_short_write_goes_on(void **state)
{
    struct scripted s;
    char answer[32];
    (void)state;
    struct message *m = begin(&s, hear_well, NULL);
    vline.write_most = 1;
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, NULL), 0);
    assert_string_equal(answer, "1");
    message_free(m);
}

static void after_half_a_command_it_gets_into_step(void **state)
{
    struct scripted s;
    char answer[32];
    struct gon_error err;
    (void)state;
    struct message *m = begin(&s, hear_well, NULL);
    vline.stuck = true;
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "took only 0 of 3 bytes"));
    vline.stuck = false;
    assert_int_equal(message_query(m, "v?", answer, sizeof answer, &err), 0);
    assert_int_equal(s.heard, 2); // "id?" came first
    message_free(m);
}

// The clock gets its turn at least every 50 ms, also while a line is being drained.
static void nothing_waits_long_without_a_turn(void **state)
{
    struct scripted s;
    char answer[32];
    (void)state;
    struct message *m = begin(&s, hear_nothing, NULL);
    for (int i = 0; i < 3; i++)
        assert_int_equal(message_query(m, "v?", answer, sizeof answer, NULL), GON_E_LINK);
    vline_turn();
    assert_true(vline.longest_ns <= MS(51));
    message_free(m);
}

// A byte every millisecond, for ever.
static void babble(struct port *p, int64_t t_ns)
{
    port_send(p, "x", 1, t_ns);
    p->tick_ns = t_ns + MS(1);
}

static void a_line_that_never_falls_silent_is_given_up(void **state)
{
    static const struct port_ops ops = {scripted_feed, babble, scripted_hangup};
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct message *m = begin(&s, hear_nothing, NULL);
    s.port.ops = &ops;
    s.port.tick_ns = vline.clk.t_ns;
    const int64_t start_ns = vline.clk.t_ns;
    assert_int_equal(transport_drain(message_transport(m), MS(100), &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "does not stop sending"));
    assert_true(vline.clk.t_ns - start_ns < CLK_S(3));
    vline_turn();
    assert_true(vline.longest_ns <= MS(51)); // others had their turn all the same
    message_free(m);
}

static void asking_again_is_bounded(void **state)
{
    struct scripted s;
    double value = -1;
    struct gon_error err;
    (void)state;
    struct message *m = begin(&s, hear_late, NULL);
    assert_int_equal(message_ask_number(m, "v?", &value, &err), 0);
    assert_true(value == 2);
    assert_int_equal(message_stats(m)->retries, 1);
    message_free(m);

    m = begin(&s, hear_nothing, NULL);
    value = -1;
    assert_int_equal(message_ask_number(m, "v?", &value, &err), GON_E_LINK);
    assert_int_equal(s.heard, 3); // the query, and two that tried to get into step
    assert_int_equal(message_stats(m)->retries, 2);
    assert_true(value == -1);
    message_free(m);
}

// --- what stands around answers ------------------------------------------------------------------

// Says what stands in the table, bit by bit: each part 3 ms after the one before.
static const char *const *replies; // command, answer, ..., NULL

static void hear_replies(struct scripted *s, const char *line, int64_t t_ns)
{
    for (int i = 0; replies[i]; i += 2)
        if (strcmp(line, replies[i]) == 0)
            for (const char *c = replies[i + 1]; *c; c++)
                port_send(&s->port, c, 1, t_ns + MS(3) + (int64_t)(c - replies[i + 1]) * MS(1));
}

static void an_echo_with_a_prompt_is_cut_off(void **state)
{
    static const struct message_format prompt = {.end_out = "\r",
                                                 .end_in = "\r> ",
                                                 .timeout_ns = MS(100),
                                                 .quiet_ns = MS(350),
                                                 .echo_end = "\r"};
    static const char *const says[] = {"freq?", "freq?\r400\r> ", "freq=400", "freq=400\r> ",
                                       "late?", "freq?\r400\r> ", NULL};
    struct scripted s;
    char answer[32];
    struct gon_error err;
    (void)state;
    replies = says;
    struct message *m = begin_as(&s, &prompt, hear_replies, NULL);
    assert_int_equal(message_query(m, "freq?", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "400");
    assert_int_equal(message_query(m, "freq=400", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, ""); // done, nothing to say
    // An answer to another question shows by its echo.
    assert_int_equal(message_query(m, "late?", answer, sizeof answer, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "does not repeat the command"));
    message_free(m);
}

static bool is_error(const void *ctx, const char *line)
{
    (void)ctx;
    return strncmp(line, "ERR", 3) == 0;
}

static void a_line_that_says_ok_belongs_to_each_answer(void **state)
{
    static const struct message_format confirmed = {.end_out = "\r\n",
                                                    .end_in = "\r\n",
                                                    .timeout_ns = MS(100),
                                                    .quiet_ns = MS(350),
                                                    .ok_line = "OK",
                                                    .alone = is_error};
    static const char *const says[] = {"p?",   "0.02\r\nOK\r\n", "p 1",  "OK\r\n",
                                       "bad",  "ERR-100\r\n",    "two?", "1\r\n2\r\n",
                                       "one?", "1\r\n",          NULL};
    struct scripted s;
    char answer[32];
    struct gon_error err;
    (void)state;
    replies = says;
    struct message *m = begin_as(&s, &confirmed, hear_replies, NULL);
    assert_int_equal(message_query(m, "p?", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "0.02");
    assert_int_equal(message_query(m, "p 1", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "");
    assert_int_equal(message_query(m, "bad", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "ERR-100"); // without an OK
    assert_int_equal(message_query(m, "two?", answer, sizeof answer, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "does not say OK"));
    assert_int_equal(message_query(m, "one?", answer, sizeof answer, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "breaks off"));
    message_free(m);
}

static void an_empty_line_is_an_answer_only_where_it_is_said(void **state)
{
    static const char *const says[] = {"go", "\r\n", "id?", "counter 7\r\n", NULL};
    struct message_format empty = format;
    struct scripted s;
    char answer[32] = "kept";
    struct gon_error err;
    (void)state;
    replies = says;
    struct message *m = begin_as(&s, &format, hear_replies, NULL);
    assert_int_equal(message_query(m, "go", answer, sizeof answer, &err), GON_E_LINK);
    message_free(m);
    empty.empty = true;
    m = begin_as(&s, &empty, hear_replies, NULL);
    assert_int_equal(message_query(m, "go", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "");
    message_free(m);
}

// 0xB7 is the sum of "x?", 0x31 that of "1".
static void checksums_are_sent_and_checked(void **state)
{
    static const struct profile_checksum sum = {
        .kind = PROFILE_SUM, .width = 8, .form = PROFILE_HEX_UPPER, .before = "*"};
    static const char *const right[] = {"x?*B7", "1*31\r\n", NULL};
    static const char *const wrong[] = {"x?*B7", "1*32\r\n", NULL};
    static const char *const missing[] = {"x?*B7", "1\r\n", NULL};
    const struct message_format summed = {.end_out = "\r",
                                          .end_in = "\r\n",
                                          .timeout_ns = MS(100),
                                          .quiet_ns = MS(350),
                                          .checksum = &sum};
    struct scripted s;
    char answer[32] = "";
    struct gon_error err;
    (void)state;
    replies = right;
    struct message *m = begin_as(&s, &summed, hear_replies, NULL);
    assert_int_equal(message_query(m, "x?", answer, sizeof answer, &err), 0);
    assert_string_equal(answer, "1");
    replies = wrong;
    assert_int_equal(message_query(m, "x?", answer, sizeof answer, &err), GON_E_LINK);
    replies = missing;
    assert_int_equal(message_query(m, "x?", answer, sizeof answer, &err), GON_E_LINK);
    message_free(m);
}

// --- many readings under faults ------------------------------------------------------------------

static uint64_t dice;

static unsigned roll(unsigned sides)
{
    dice ^= dice << 13;
    dice ^= dice >> 7;
    dice ^= dice << 17;
    return (unsigned)(dice >> 33) % sides;
}

// Lost, late, doubled at once, garbage before or after, cut, unreadable: a tenth of the answers.
static void hear_with_faults(struct scripted *s, const char *line, int64_t t_ns)
{
    char text[64];
    count(s, line, text);
    const int64_t due_ns = t_ns + MS(1) + (int64_t)roll(20) * MS(1);
    switch (roll(80)) {
    case 0: return;
    case 1: scripted_say(s, text, t_ns + MS(101) + (int64_t)roll(200) * MS(1)); return;
    case 2: scripted_say(s, text, due_ns); break;
    case 3: scripted_say(s, "\x01\xfe", due_ns); break;
    case 4: text[strlen(text) - 2] = 0; break;
    case 5: text[0] = (char)0xb7; break;
    case 6:
        scripted_say(s, text, due_ns);
        scripted_say(s, "\xc0", due_ns);
        return;
    case 7:
        scripted_say(s, text, due_ns);
        scripted_say(s, text, due_ns + MS(4));
        return;
    default: break;
    }
    scripted_say(s, text, due_ns);
}

// Without any protection: writes, and takes the next line for the answer.
static int ask_bluntly(struct transport *t, double *ret_value)
{
    char line[128];
    size_t have = 0;
    const int64_t deadline_ns = vline.clk.t_ns + MS(100);
    transport_write(t, "v?\r", 3, deadline_ns, NULL);
    while (have < sizeof line - 1 && (have == 0 || line[have - 1] != '\n')) {
        int rc = transport_read(t, line + have, 1, deadline_ns, NULL);
        if (rc < 0)
            return rc;
        have++;
    }
    line[have >= 2 ? have - 2 : 0] = 0;
    return message_number(line, ret_value, NULL);
}

static void no_wrong_value_under_faults(void **state)
{
    struct scripted s;
    int good = 0, wrong = 0, wrong_bluntly = 0;
    (void)state;
    dice = 20240917;
    print_message("seed %llu\n", (unsigned long long)dice);
    struct message *m = begin(&s, hear_with_faults, NULL);
    for (int i = 0; i < 5000; i++) {
        double value;
        if (message_ask_number(m, "v?", &value, NULL) < 0)
            continue;
        good++;
        wrong += value != s.step; // it counts what it is asked
    }
    for (int i = 0; i < 5000; i++) {
        double value;
        if (ask_bluntly(message_transport(m), &value) == 0)
            wrong_bluntly += value != s.step;
    }
    print_message("5000 readings: %d answered, %d wrong; without protection %d wrong\n", good,
                  wrong, wrong_bluntly);
    assert_int_equal(wrong, 0);
    assert_true(good > 4900);
    assert_true(wrong_bluntly > 100);
    message_free(m);
}

// --- numbers -------------------------------------------------------------------------------------

static void numbers_as_instruments_write_them(void **state)
{
    static const struct {
        const char *text;
        double value;
    } good[] = {
        {"0", 0},
        {"-0.0", 0},
        {"6.10356e-005", 6.10356e-005},
        {"+1.040564E-06", 1.040564e-06},
        {" 1000.00 ", 1000},
        {".5", 0.5},
        {"5.", 5},
        {"-12.5e+2", -1250},
        {"123456789012345678901234567890", 123456789012345678901234567890.0},
        {"0.000000000000000000000000000012345678901234567890123", 1.2345678901234567890123e-29},
        {"1e-400", 0},
        {"9.89e37", 9.89e37},
        {"1e0000000000000000000002", 100},
    };
    (void)state;
    for (size_t i = 0; i < sizeof good / sizeof good[0]; i++) {
        double value = -1;
        assert_int_equal(message_number(good[i].text, &value, NULL), 0);
        assert_true(fabs(value - good[i].value) <= 2.3e-16 * fabs(good[i].value));
    }
}

static void what_is_no_number_is_an_error(void **state)
{
    static const char *const bad[] = {
        "",        " ",        "1,234",   "1.2.3", "nan",   "NAN",  "inf", "-INF", "9.9e37",
        "9.91E37", "-9.9E+37", "1e99999", "1.00W", "25.3C", "0x10", "1e",  "1e+",  "e5",
        "--1",     "+-1",      "1 2",     "OVLD",  "OK",    ".",    "-"};
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        double value = 42;
        struct gon_error err;
        assert_int_equal(message_number(bad[i], &value, &err), GON_E_LINK);
        assert_true(value == 42 && err.text[0]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(answers_come_without_terminator_and_blanks),
        cmocka_unit_test(the_gap_is_kept),
        cmocka_unit_test(an_answer_split_at_every_byte_is_reassembled),
        cmocka_unit_test(a_partial_line_waits_for_its_rest),
        cmocka_unit_test(a_late_answer_is_not_taken_for_the_next_ones),
        cmocka_unit_test(a_doubled_answer_is_dropped),
        cmocka_unit_test(unreadable_bytes_are_no_answer),
        cmocka_unit_test(a_line_without_end_is_capped),
        cmocka_unit_test(an_echo_is_named),
        cmocka_unit_test(a_hang_up_is_no_timeout),
        cmocka_unit_test(waiting_can_be_cancelled_but_not_what_must_be_said),
        cmocka_unit_test(a_short_write_goes_on),
        cmocka_unit_test(after_half_a_command_it_gets_into_step),
        cmocka_unit_test(nothing_waits_long_without_a_turn),
        cmocka_unit_test(a_line_that_never_falls_silent_is_given_up),
        cmocka_unit_test(asking_again_is_bounded),
        cmocka_unit_test(an_echo_with_a_prompt_is_cut_off),
        cmocka_unit_test(a_line_that_says_ok_belongs_to_each_answer),
        cmocka_unit_test(an_empty_line_is_an_answer_only_where_it_is_said),
        cmocka_unit_test(checksums_are_sent_and_checked),
        cmocka_unit_test(no_wrong_value_under_faults),
        cmocka_unit_test(numbers_as_instruments_write_them),
        cmocka_unit_test(what_is_no_number_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
