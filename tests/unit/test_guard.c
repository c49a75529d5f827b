// SPDX-License-Identifier: MIT
// uses: guard base
// The guard's decisions, step by step. Times in ms; the laser is a Cobolt: 100 ms between commands.
#include "guard/guard.h"
#include "base/err.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#define MS INT64_C(1000000)
#define OFF "\rl0\r"
#define END_OFF "\r@cob0\r"
#define LIGHT "l?\r"
#define MODE "gom?\r"

struct bench {
    struct guard g;
    struct guard_acts acts;
    int next; // of the acts, to be looked at
    int64_t t_ms;
};

static struct guard_bytes bytes_of(const char *text)
{
    struct guard_bytes b = {.size = (uint8_t)strlen(text)};
    memcpy(b.at, text, b.size);
    return b;
}

static struct guard_record record(void)
{
    struct guard_record r = {
        .link = "serial:/dev/laser",
        .end_out = bytes_of("\r"),
        .end_in = bytes_of("\r\n"),
        .gap_ns = 100 * MS,
        .timeout_ns = 150 * MS,
        .quiet_ns = 350 * MS,
        .reopen_ns = 500 * MS,
        .offs = 2,
        .ons = 2,
        .asks = 2,
        .off = {bytes_of(OFF), bytes_of(END_OFF)},
        .on = {bytes_of("l1"), bytes_of("@cob1")},
        .ask = {{bytes_of(LIGHT), "^ *0 *$"}, {bytes_of(MODE), "^ *[04-8] *$"}},
    };
    return r;
}

static void happens(struct bench *b, struct guard_event e)
{
    assert_int_equal(b->next, b->acts.count); // all that was to be done was looked at
    b->next = 0;
    e.text = e.text ? e.text : "";
    guard_step(&b->g, b->t_ms * MS, &e, &b->acts);
}

static void time_comes(struct bench *b)
{
    b->t_ms = guard_next_ns(&b->g) / MS;
    happens(b, (struct guard_event){.kind = GUARD_ON_TIME});
}

static void message(struct bench *b, char kind, const void *bytes, size_t size)
{
    char m[sizeof(struct guard_record) + 8] = {kind};
    memcpy(m + 1, bytes, size);
    happens(b, (struct guard_event){.kind = GUARD_ON_MESSAGE, .bytes = m, .size = size + 1});
}

static void command(struct bench *b, const char *text)
{
    message(b, 'D', text, strlen(text));
}

static void laser_says(struct bench *b, const char *text)
{
    happens(b, (struct guard_event){.kind = GUARD_ON_BYTES, .bytes = text, .size = strlen(text)});
}

static void comes_of_it(struct bench *b, enum guard_event_kind kind, int code)
{
    happens(b, (struct guard_event){.kind = kind, .code = code, .text = code ? "why" : ""});
}

static const struct guard_act *does(struct bench *b, enum guard_act_kind kind)
{
    assert_true(b->next < b->acts.count);
    const struct guard_act *a = &b->acts.act[b->next++];
    assert_int_equal(a->kind, kind);
    return a;
}

static void writes(struct bench *b, const char *text)
{
    const struct guard_act *a = does(b, GUARD_WRITE);
    assert_int_equal(a->size, strlen(text));
    assert_memory_equal(a->bytes, text, a->size);
}

static void tells(struct bench *b, const char *text)
{
    const struct guard_act *a = does(b, GUARD_TELL);
    assert_int_equal(a->size, strlen(text));
    assert_memory_equal(a->bytes, text, a->size);
}

static void refuses(struct bench *b, int code)
{
    const struct guard_act *a = does(b, GUARD_TELL);
    struct guard_no no;
    assert_int_equal(a->size, 1 + sizeof no);
    assert_int_equal(a->bytes[0], 'e');
    memcpy(&no, a->bytes + 1, sizeof no);
    assert_int_equal(no.code, code);
}

static void says(struct bench *b, const char *begin)
{
    const struct guard_act *a = does(b, GUARD_SAY);
    assert_true(a->size >= strlen(begin) && a->bytes[a->size - 1] == '\n');
    assert_memory_equal(a->bytes, begin, strlen(begin));
}

static struct guard_status status(struct bench *b)
{
    const struct guard_act *a = does(b, GUARD_TELL);
    struct guard_status s;
    assert_int_equal(a->size, 1 + sizeof s);
    assert_int_equal(a->bytes[0], 's');
    memcpy(&s, a->bytes + 1, sizeof s);
    assert_memory_equal(&s, &b->g.status, sizeof s);
    return s;
}

static void becomes(struct bench *b, enum guard_phase phase)
{
    assert_int_equal(status(b).phase, phase);
}

// The rest of a round after the OFF that went out at once, when it has an effect.
static void confirms(struct bench *b)
{
    time_comes(b);
    writes(b, OFF);
    time_comes(b);
    writes(b, LIGHT);
    laser_says(b, "0\r\n");
    time_comes(b);
    writes(b, MODE);
    laser_says(b, "0\r\n");
    says(b, "laser off: read back from serial:/dev/laser\n");
}

static void begin(struct bench *b)
{
    *b = (struct bench){.t_ms = 1000};
    guard_init(&b->g);
    assert_true(guard_next_ns(&b->g) == INT64_MAX);
}

// A laser that was handed over and is off.
static void begin_dark(struct bench *b)
{
    const struct guard_record r = record();
    begin(b);
    message(b, 'R', &r, sizeof r);
    does(b, GUARD_OPEN);
    becomes(b, GUARD_SAFING);
    comes_of_it(b, GUARD_ON_OPENED, 0);
    tells(b, "d");
    writes(b, OFF);
    confirms(b);
    becomes(b, GUARD_DARK);
    assert_int_equal(b->t_ms, 1000 + 120 + 120 + 100);
}

static void begin_lit(struct bench *b)
{
    begin_dark(b);
    b->t_ms += 1000;
    command(b, "l1\r");
    writes(b, "l1\r");
    becomes(b, GUARD_LIT);
    comes_of_it(b, GUARD_ON_DONE, 0);
    tells(b, "d");
    laser_says(b, "OK\r\n");
    const struct guard_act *a = does(b, GUARD_TELL);
    assert_int_equal(a->size, 6);
    assert_memory_equal(a->bytes, "b\0OK\r\n", 6);
}

// --- without a laser -----------------------------------------------------------------------------

static void without_a_record_nothing_is_forwarded_and_nothing_can_be_on(void **state)
{
    (void)state;
    struct bench b;
    const uint32_t number = 7;
    begin(&b);
    command(&b, "l1\r");
    refuses(&b, GON_E_REFUSED);
    message(&b, 'X', &number, sizeof number);
    assert_int_equal(status(&b).done, 7);
    comes_of_it(&b, GUARD_ON_STOP, 0);
    says(&b, "no laser was handed over\n");
    comes_of_it(&b, GUARD_ON_SIGNAL, 0);
    says(&b, "no laser was handed over\n");
    comes_of_it(&b, GUARD_ON_GONE, 0);
    does(&b, GUARD_END);
}

static void a_record_of_another_version_is_refused(void **state)
{
    (void)state;
    struct bench b;
    const struct guard_record r = {.link = ""};
    begin(&b);
    message(&b, 'R', &r, sizeof r - 1);
    refuses(&b, GON_E_REFUSED);
    assert_int_equal(b.g.status.phase, GUARD_EMPTY);
}

static void a_port_that_is_not_there_is_tried_again_until_it_is(void **state)
{
    (void)state;
    struct bench b;
    const struct guard_record r = record();
    begin(&b);
    message(&b, 'R', &r, sizeof r);
    does(&b, GUARD_OPEN);
    becomes(&b, GUARD_SAFING);
    comes_of_it(&b, GUARD_ON_OPENED, GON_E_GONE);
    refuses(&b, GON_E_GONE);
    assert_int_equal(status(&b).seen, GUARD_SEEN_NO_PORT);
    command(&b, "l?\r");
    refuses(&b, GON_E_GONE);
    time_comes(&b);
    assert_int_equal(b.t_ms, 1500);
    does(&b, GUARD_OPEN);
    comes_of_it(&b, GUARD_ON_OPENED, 0);
    writes(&b, OFF);
    confirms(&b);
    becomes(&b, GUARD_DARK);
}

static void a_laser_is_not_exchanged_for_another_before_it_is_off(void **state)
{
    (void)state;
    struct bench b;
    struct guard_record r = record();
    begin_lit(&b);
    strcpy(r.link, "tcp:elsewhere:1");
    message(&b, 'R', &r, sizeof r);
    refuses(&b, GON_E_REFUSED);
    begin_dark(&b);
    message(&b, 'R', &r, sizeof r);
    does(&b, GUARD_OPEN); // closes the one before
    becomes(&b, GUARD_SAFING);
}

static void the_same_laser_once_more_is_switched_off_without_opening_it_again(void **state)
{
    (void)state;
    struct bench b;
    const struct guard_record r = record();
    begin_lit(&b);
    message(&b, 'R', &r, sizeof r);
    writes(&b, OFF);
    tells(&b, "d");
    becomes(&b, GUARD_SAFING);
    confirms(&b);
    becomes(&b, GUARD_DARK);
}

// --- forwarding ----------------------------------------------------------------------------------

static void whole_commands_and_their_answers_pass(void **state)
{
    (void)state;
    struct bench b;
    begin_dark(&b);
    command(&b, "ilk?\r");
    writes(&b, "ilk?\r");
    comes_of_it(&b, GUARD_ON_DONE, 0);
    tells(&b, "d");
    command(&b, "p 0.1\r");
    writes(&b, "p 0.1\r");
    comes_of_it(&b, GUARD_ON_DONE, GON_E_LINK);
    refuses(&b, GON_E_LINK);
    assert_int_equal(b.g.status.phase, GUARD_DARK);
}

static void half_a_command_does_not(void **state)
{
    (void)state;
    struct bench b;
    begin_dark(&b);
    command(&b, "p 0.");
    refuses(&b, GON_E_INPUT);
    command(&b, "\r");
    refuses(&b, GON_E_INPUT);
    command(&b, "");
    refuses(&b, GON_E_INPUT);
    message(&b, 'A', "", 0);
    refuses(&b, GON_E_INPUT);
}

static void light_is_recognized_wherever_a_command_begins(void **state)
{
    (void)state;
    static const char *const on[] = {"l1\r", "L1\r", "\rl1\r", "p?;l1\r", "cf @cob1\r", "@COB1\r"};
    static const char *const harmless[] = {"l?\r", "l0\r", "pl1\r", "x@cob1\r", "@cob\r", "l\r"};
    struct bench b;
    for (int i = 0; i < 6; i++) {
        begin_dark(&b);
        command(&b, on[i]);
        writes(&b, on[i]);
        becomes(&b, GUARD_LIT);
        begin_dark(&b);
        command(&b, harmless[i]);
        writes(&b, harmless[i]);
        assert_int_equal(b.next, b.acts.count);
    }
}

static void what_comes_when_nobody_is_there_is_dropped(void **state)
{
    (void)state;
    struct bench b;
    begin_dark(&b);
    comes_of_it(&b, GUARD_ON_GONE, 0);
    writes(&b, OFF); // the last word to a laser is always OFF
    does(&b, GUARD_END);
    laser_says(&b, "OK\r\n");
}

// --- the lease -----------------------------------------------------------------------------------

static void a_lease_that_is_renewed_goes_on(void **state)
{
    (void)state;
    struct bench b;
    begin_lit(&b);
    for (int i = 0; i < 20; i++) {
        b.t_ms += 499;
        happens(&b, (struct guard_event){.kind = GUARD_ON_TIME});
        message(&b, 'L', "", 0);
    }
    assert_int_equal(b.g.status.phase, GUARD_LIT);
}

static void a_lease_that_runs_out_means_off_and_the_client_is_not_heard(void **state)
{
    (void)state;
    struct bench b;
    const uint32_t number = 3;
    begin_lit(&b);
    const int64_t on_ms = b.t_ms;
    time_comes(&b);
    assert_int_equal(b.t_ms, on_ms + 500);
    writes(&b, OFF);
    struct guard_status s = status(&b);
    assert_true(s.latched && s.why == GUARD_LEASE && s.phase == GUARD_SAFING);
    message(&b, 'L', "", 0); // too late
    command(&b, "l1\r");
    refuses(&b, GON_E_REFUSED);
    confirms(&b);
    assert_true(status(&b).latched);
    command(&b, "l1\r"); // still
    refuses(&b, GON_E_REFUSED);
    message(&b, 'X', &number, sizeof number);
    writes(&b, OFF);
    s = status(&b);
    assert_true(!s.latched && s.why == GUARD_ASKED && s.done == 0);
    confirms(&b);
    assert_int_equal(status(&b).done, 3);
    command(&b, "l1\r");
    writes(&b, "l1\r");
    becomes(&b, GUARD_LIT);
}

static void stop_and_signals_mean_off(void **state)
{
    (void)state;
    static const struct {
        enum guard_event_kind kind;
        enum guard_why why;
    } all[] = {{GUARD_ON_STOP, GUARD_STOP}, {GUARD_ON_SIGNAL, GUARD_SIGNAL}};
    struct bench b;
    for (int i = 0; i < 2; i++) {
        begin_lit(&b);
        comes_of_it(&b, all[i].kind, 0);
        writes(&b, OFF);
        struct guard_status s = status(&b);
        assert_true(s.latched && s.why == all[i].why && s.phase == GUARD_SAFING);
        comes_of_it(&b, all[i].kind, 0); // twice is no more than once
        confirms(&b);
        becomes(&b, GUARD_DARK);
    }
}

static void the_client_gone_means_off_and_then_the_end(void **state)
{
    (void)state;
    struct bench b;
    begin_lit(&b);
    const int64_t gone_ms = b.t_ms;
    comes_of_it(&b, GUARD_ON_GONE, 0);
    writes(&b, OFF);
    confirms(&b);
    assert_int_equal(b.t_ms, gone_ms + 120 + 120 + 100); // nothing was owed
    does(&b, GUARD_END);
}

// --- until it is read back -----------------------------------------------------------------------

static void off_is_repeated_in_turn_while_the_laser_says_that_it_is_on(void **state)
{
    (void)state;
    struct bench b;
    const uint32_t number = 1;
    begin_lit(&b);
    message(&b, 'X', &number, sizeof number);
    writes(&b, OFF);
    becomes(&b, GUARD_SAFING);
    for (int round = 0; round < 4; round++) {
        time_comes(&b);
        writes(&b, round % 2 ? END_OFF : OFF);
        time_comes(&b);
        writes(&b, LIGHT);
        laser_says(&b, "1\r\n");
        if (round == 0)
            assert_int_equal(status(&b).seen, GUARD_SEEN_ON);
        time_comes(&b); // another answer could follow
    }
    time_comes(&b);
    writes(&b, OFF);
    b.t_ms += 1;
    command(&b, "l1\r");
    refuses(&b, GON_E_DEVICE);
    message(&b, 'X', &number, sizeof number); // goes on anyway
    b.next = b.acts.count;
    time_comes(&b);
    writes(&b, LIGHT);
    laser_says(&b, "0\r\n");
    time_comes(&b);
    writes(&b, MODE);
    laser_says(&b, "3\r\n"); // it is starting
    time_comes(&b);
    time_comes(&b);
    writes(&b, END_OFF);
}

static void a_laser_that_is_silent_is_told_again(void **state)
{
    (void)state;
    struct bench b;
    begin_lit(&b);
    comes_of_it(&b, GUARD_ON_GONE, 0);
    writes(&b, OFF);
    for (int round = 0; round < 3; round++) {
        time_comes(&b);
        writes(&b, round % 2 ? END_OFF : OFF);
        time_comes(&b);
        writes(&b, LIGHT);
        const int64_t asked_ms = b.t_ms;
        time_comes(&b);
        assert_int_equal(b.t_ms, asked_ms + 150);
        assert_int_equal(b.g.status.seen, GUARD_SEEN_SILENCE);
    }
    time_comes(&b);
    writes(&b, END_OFF);
    time_comes(&b);
    writes(&b, LIGHT);
    laser_says(&b, "0\r\n");
    time_comes(&b);
    writes(&b, MODE);
    laser_says(&b, "0\r\n");
    says(&b, "laser off");
    does(&b, GUARD_END);
}

static void while_it_is_silent_the_client_is_told_so(void **state)
{
    (void)state;
    struct bench b;
    const uint32_t number = 1;
    begin_dark(&b);
    message(&b, 'X', &number, sizeof number);
    writes(&b, OFF);
    becomes(&b, GUARD_SAFING);
    command(&b, "l?\r");
    refuses(&b, GON_E_LINK);
}

static void the_gap_is_kept_also_where_an_answer_is_given_up_sooner(void **state)
{
    (void)state;
    struct bench b;
    struct guard_record r = record();
    r.timeout_ns = 10 * MS;
    begin(&b);
    message(&b, 'R', &r, sizeof r);
    does(&b, GUARD_OPEN);
    becomes(&b, GUARD_SAFING);
    comes_of_it(&b, GUARD_ON_OPENED, 0);
    tells(&b, "d");
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, LIGHT);
    const int64_t asked_ms = b.t_ms;
    time_comes(&b);
    assert_int_equal(b.t_ms, asked_ms + 10);
    assert_int_equal(status(&b).seen, GUARD_SEEN_SILENCE);
    time_comes(&b);
    assert_int_equal(b.t_ms, asked_ms + 120);
    writes(&b, END_OFF);
}

static void a_late_answer_to_somebody_elses_question_is_not_taken_for_off(void **state)
{
    (void)state;
    struct bench b;
    begin_lit(&b);
    command(&b, "ilk?\r"); // will be answered 0, too
    writes(&b, "ilk?\r");
    comes_of_it(&b, GUARD_ON_DONE, 0);
    tells(&b, "d");
    comes_of_it(&b, GUARD_ON_GONE, 0);
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, OFF);
    const int64_t told_ms = b.t_ms;
    laser_says(&b, "0\r\n"); // late, and before our question: dropped
    time_comes(&b);
    assert_int_equal(b.t_ms, told_ms + 120 + 350);
    writes(&b, LIGHT);
}

static void an_answer_may_come_in_pieces_behind_other_lines_and_with_blanks(void **state)
{
    (void)state;
    struct bench b;
    begin_lit(&b);
    comes_of_it(&b, GUARD_ON_GONE, 0);
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, LIGHT);
    laser_says(&b, "OK\r\nl?\r\n");
    laser_says(&b, " ");
    laser_says(&b, "0 \r");
    laser_says(&b, "\n1\r\n"); // what is too much is not looked at
    time_comes(&b);
    writes(&b, MODE);
    laser_says(&b, "8\r\n");
    says(&b, "laser off");
    does(&b, GUARD_END);
}

static void a_line_without_end_is_no_answer(void **state)
{
    (void)state;
    struct bench b;
    char long_line[GUARD_DATA + 1];
    memset(long_line, '0', sizeof long_line - 1);
    long_line[sizeof long_line - 1] = 0;
    begin_lit(&b);
    comes_of_it(&b, GUARD_ON_GONE, 0);
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, LIGHT);
    laser_says(&b, long_line);
    assert_int_equal(b.g.status.seen, GUARD_SEEN_ON);
    laser_says(&b, "\r\n");
    laser_says(&b, "\r\n");
    assert_int_equal(b.g.status.phase, GUARD_SAFING);
}

static void a_checksum_at_the_end_is_not_looked_at(void **state)
{
    (void)state;
    struct bench b;
    begin_lit(&b);
    b.g.record.tail = 3;
    comes_of_it(&b, GUARD_ON_GONE, 0);
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, LIGHT);
    laser_says(&b, "*A\r\n0*7F\r\n"); // one that is nothing but that, then the answer
    time_comes(&b);
    writes(&b, MODE);
}

static void an_expression_that_cannot_be_read_never_says_off(void **state)
{
    (void)state;
    struct bench b;
    begin_lit(&b);
    b.g.record.asks = 1;
    strcpy(b.g.record.ask[0].off, "(");
    comes_of_it(&b, GUARD_ON_GONE, 0);
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, OFF);
    time_comes(&b);
    writes(&b, LIGHT);
    laser_says(&b, "0\r\n");
    assert_int_equal(b.g.status.phase, GUARD_SAFING);
}

// --- a port that goes ----------------------------------------------------------------------------

static void a_port_that_is_unplugged_with_light_on_is_opened_again_and_told_off(void **state)
{
    (void)state;
    struct bench b;
    begin_lit(&b);
    comes_of_it(&b, GUARD_ON_DONE, GON_E_GONE);
    becomes(&b, GUARD_SAFING);
    comes_of_it(&b, GUARD_ON_GONE, 0);
    time_comes(&b);
    does(&b, GUARD_OPEN);
    comes_of_it(&b, GUARD_ON_OPENED, GON_E_GONE); // for as long as it takes
    time_comes(&b);
    does(&b, GUARD_OPEN);
    comes_of_it(&b, GUARD_ON_OPENED, 0);
    writes(&b, OFF);
    comes_of_it(&b, GUARD_ON_DONE, 0); // nobody waits for that
    confirms(&b);
    does(&b, GUARD_END);
}

static void one_of_a_simulator_is_given_up_when_nobody_is_there(void **state)
{
    (void)state;
    struct bench b;
    begin_lit(&b);
    b.g.record.brief = true;
    comes_of_it(&b, GUARD_ON_DONE, GON_E_GONE);
    becomes(&b, GUARD_SAFING);
    time_comes(&b);
    does(&b, GUARD_OPEN);
    comes_of_it(&b, GUARD_ON_OPENED, GON_E_GONE);
    comes_of_it(&b, GUARD_ON_GONE, 0);
    time_comes(&b);
    does(&b, GUARD_OPEN);
    comes_of_it(&b, GUARD_ON_OPENED, GON_E_GONE);
    does(&b, GUARD_END);
}

static void one_that_is_unplugged_while_dark_is_left_alone_until_it_is_wanted(void **state)
{
    (void)state;
    struct bench b;
    const uint32_t number = 1;
    begin_dark(&b);
    comes_of_it(&b, GUARD_ON_DONE, GON_E_GONE);
    assert_int_equal(status(&b).seen, GUARD_SEEN_NO_PORT);
    assert_true(guard_next_ns(&b.g) == INT64_MAX);
    message(&b, 'X', &number, sizeof number);
    becomes(&b, GUARD_SAFING);
    time_comes(&b);
    does(&b, GUARD_OPEN);
    begin_dark(&b);
    comes_of_it(&b, GUARD_ON_DONE, GON_E_GONE);
    becomes(&b, GUARD_DARK);
    comes_of_it(&b, GUARD_ON_GONE, 0);
    does(&b, GUARD_END);
}

// --- links with messages -------------------------------------------------------------------------

static void over_usb_answers_are_fetched(void **state)
{
    (void)state;
    struct bench b;
    const int64_t wait_ns = 300 * MS;
    begin_dark(&b);
    b.g.record.framed = true;
    message(&b, 'C', &wait_ns, sizeof wait_ns);
    assert_true(does(&b, GUARD_CLEAR)->wait_ns == wait_ns);
    comes_of_it(&b, GUARD_ON_DONE, 0);
    tells(&b, "d");
    message(&b, 'A', &wait_ns, sizeof wait_ns);
    assert_true(does(&b, GUARD_READ)->wait_ns == wait_ns);
    happens(&b, (struct guard_event){GUARD_ON_BYTES, "0\n", 2, true, 0, ""});
    const struct guard_act *a = does(&b, GUARD_TELL);
    assert_int_equal(a->size, 4);
    assert_memory_equal(a->bytes,
                        "b\1"
                        "0\n",
                        4);
    message(&b, 'A', &wait_ns, sizeof wait_ns);
    does(&b, GUARD_READ);
    comes_of_it(&b, GUARD_ON_DONE, GON_E_CANCELED);
    refuses(&b, GON_E_CANCELED);
    comes_of_it(&b, GUARD_ON_STOP, 0);
    writes(&b, OFF);
    becomes(&b, GUARD_SAFING);
    time_comes(&b);
    writes(&b, OFF);
    time_comes(&b);
    does(&b, GUARD_CLEAR);
    writes(&b, LIGHT);
    assert_true(does(&b, GUARD_READ)->wait_ns == 150 * MS);
    happens(&b, (struct guard_event){GUARD_ON_BYTES, "0", 1, false, 0, ""});
    comes_of_it(&b, GUARD_ON_DONE, GON_E_LINK); // nobody waits for that
    happens(&b, (struct guard_event){GUARD_ON_BYTES, "10", 2, true, 0, ""}); // "010" in two parts
    assert_int_equal(status(&b).seen, GUARD_SEEN_ON);
    happens(&b, (struct guard_event){GUARD_ON_BYTES, "0", 1, true, 0, ""}); // ends where it says so
    time_comes(&b);
    does(&b, GUARD_CLEAR);
    writes(&b, MODE);
    does(&b, GUARD_READ);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_a_record_nothing_is_forwarded_and_nothing_can_be_on),
        cmocka_unit_test(a_record_of_another_version_is_refused),
        cmocka_unit_test(a_port_that_is_not_there_is_tried_again_until_it_is),
        cmocka_unit_test(a_laser_is_not_exchanged_for_another_before_it_is_off),
        cmocka_unit_test(the_same_laser_once_more_is_switched_off_without_opening_it_again),
        cmocka_unit_test(whole_commands_and_their_answers_pass),
        cmocka_unit_test(half_a_command_does_not),
        cmocka_unit_test(light_is_recognized_wherever_a_command_begins),
        cmocka_unit_test(what_comes_when_nobody_is_there_is_dropped),
        cmocka_unit_test(a_lease_that_is_renewed_goes_on),
        cmocka_unit_test(a_lease_that_runs_out_means_off_and_the_client_is_not_heard),
        cmocka_unit_test(stop_and_signals_mean_off),
        cmocka_unit_test(the_client_gone_means_off_and_then_the_end),
        cmocka_unit_test(off_is_repeated_in_turn_while_the_laser_says_that_it_is_on),
        cmocka_unit_test(a_laser_that_is_silent_is_told_again),
        cmocka_unit_test(while_it_is_silent_the_client_is_told_so),
        cmocka_unit_test(the_gap_is_kept_also_where_an_answer_is_given_up_sooner),
        cmocka_unit_test(a_late_answer_to_somebody_elses_question_is_not_taken_for_off),
        cmocka_unit_test(an_answer_may_come_in_pieces_behind_other_lines_and_with_blanks),
        cmocka_unit_test(a_line_without_end_is_no_answer),
        cmocka_unit_test(a_checksum_at_the_end_is_not_looked_at),
        cmocka_unit_test(an_expression_that_cannot_be_read_never_says_off),
        cmocka_unit_test(a_port_that_is_unplugged_with_light_on_is_opened_again_and_told_off),
        cmocka_unit_test(one_of_a_simulator_is_given_up_when_nobody_is_there),
        cmocka_unit_test(one_that_is_unplugged_while_dark_is_left_alone_until_it_is_wanted),
        cmocka_unit_test(over_usb_answers_are_fetched),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
