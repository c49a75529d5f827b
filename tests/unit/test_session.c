// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// A session over a text link, in a profile made for these tests: what is believed, what is sent
// again and what is not, refusals and error queues, checksums.
#include "drivers/session.h"

#include "drivers/message.h"
#include "drivers/transport.h"
#include "tests/unit/profiled.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#define MS(ms) CLK_MS(ms)

#define HEAD                                                                                       \
    "profile: { name = \"test\"; title = \"counter\"; role = \"inputs\"; protocol = "              \
    "\"message\";\n"                                                                               \
    "  source = \"this test\"; };\n"
#define VALUES                                                                                     \
    "values: ( { name = \"id\"; type = \"string\"; }, { name = \"serial\"; type = \"string\"; "    \
    "},\n"                                                                                         \
    "  { name = \"x\"; min = 0; max = 10000; }, { name = \"most\"; max = 10000; },\n"              \
    "  { name = \"level\"; max = 100; resolution = 0.01; },\n"                                     \
    "  { name = \"mode\"; type = \"int\"; max = 5; }, { name = \"stamp\"; changes = true; },\n"    \
    "  { name = \"temperature\"; valid = \"mode = 1\"; },\n"                                       \
    "  { name = \"esr\"; type = \"int\"; max = 255;\n"                                             \
    "    bits = ( { bit = 5; name = \"command\"; help = \"unknown\"; },\n"                         \
    "             { bit = 7; name = \"power_on\"; } ); } );\n"
#define EXCHANGES                                                                                  \
    "exchanges: ( { name = \"who\"; send = \"id?\"; answer = \"{id},{serial}\"; },\n"              \
    "  { name = \"x\"; send = \"x?\"; answer = \"{x}\"; believe = \"x <= most\"; },\n"             \
    "  { name = \"slow\"; send = \"slow?\"; answer = \"{x}\"; timeout_ms = 900; },\n"              \
    "  { name = \"read\"; send = \"r?\"; answer = \"{x},{stamp}\"; },\n"                           \
    "  { name = \"warm\"; send = \"t?\"; answer = \"{mode},{temperature}\"; },\n"                  \
    "  { name = \"level\"; send = \"l?\"; answer = \"{level}\"; },\n"                              \
    "  { name = \"set_level\"; send = \"l {level:.2f}\"; answer = \"OK\"; verify = \"level\"; "    \
    "},\n"                                                                                         \
    "  { name = \"set_echoed\"; send = \"e {level:.2f}\"; answer = \"{level}\"; echoes = true;\n"  \
    "    verify = \"level\"; },\n"                                                                 \
    "  { name = \"set_checked\"; send = \"c {level:.2f}\"; check = true; },\n"                     \
    "  { name = \"go\"; send = \"go\"; answer = \"OK\"; },\n"                                      \
    "  { name = \"errors\"; send = \"esr?\"; answer = \"{esr}\"; } );\n"                           \
    "refusals: ( { like = \"busy*\"; means = \"busy\"; }, { like = \"error*lock*\"; means = "      \
    "\"interlock\"; },\n"                                                                          \
    "  { like = \"error*\"; } );\n"                                                                \
    "errors: { ask = \"errors\"; fine = \"esr lacks 0x20\"; };\n"                                  \
    "identify: { asks = ( \"who\" ); title = \"{id}, serial {serial}\"; restarted = "              \
    "\"esr.power_on\";\n"                                                                          \
    "  refuse = ( { when = \"id !~ 'counter'\"; text = \"not a counter\"; } ); };\n"               \
    "inputs: { status = ( \"x\" ); };\n"
#define FRAMING                                                                                    \
    "framing: { end_out = \"\\r\"; end_in = \"\\r\\n\"; timeout_ms = 100; quiet_ms = 350; sync = " \
    "\"who\"; };\n"

static struct profile *profile;
static const char *answers[32][2]; // what a test wants to be answered: command (prefix), answer
static int answered;               // how many answers so far

static const char *answer_to(const char *command)
{
    for (int i = 0; i < 32 && answers[i][0]; i++)
        if (strncmp(command, answers[i][0], strlen(answers[i][0])) == 0)
            return answers[i][1];
    return NULL;
}

static void hear(struct scripted *s, const char *command, int64_t t_ns)
{
    const char *answer = answer_to(command);
    char text[128];
    if (!answer)
        return;
    answered++;
    snprintf(text, sizeof text, "%s\r\n", answer);
    scripted_say(s, text, t_ns + MS(5));
}

static struct session *begin_with(struct scripted *s, const char *text,
                                  void (*hears)(struct scripted *, const char *, int64_t))
{
    struct session *z;
    struct gon_error err;
    free(profile);
    profile = profiles_parse(text);
    scripted_init(s, "\r", hears);
    struct clk *clk = vline_begin(&s->port);
    if (session_open(profile, vline.link, clk, NULL, &z, &err) < 0)
        fail_msg("%s", err.text);
    return z;
}

static struct session *begin(struct scripted *s)
{
    memset(answers, 0, sizeof answers);
    answers[0][0] = "id?";
    answers[0][1] = "counter,007";
    answered = 0;
    return begin_with(s, HEAD VALUES FRAMING EXCHANGES, hear);
}

static void answer(int i, const char *command, const char *text)
{
    answers[i][0] = command;
    answers[i][1] = text;
}

static void it_says_who_it_is_and_is_refused_when_it_is_another(void **state)
{
    struct scripted s;
    struct gon_error err;
    char title[80];
    (void)state;
    struct session *z = begin(&s);
    assert_int_equal(s.heard, 0);
    assert_int_equal(session_identify(z, title, sizeof title, &err), 0);
    assert_string_equal(title, "counter, serial 007");
    answer(0, "id?", "timer,008");
    assert_int_equal(session_identify(z, title, sizeof title, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "is 'timer, serial 008': not a counter"));
    answer(0, "id?", "error 5");
    assert_int_equal(session_identify(z, title, sizeof title, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "is it a counter?"));
    session_free(z);
}

static void what_does_not_fit_is_asked_again_three_times(void **state)
{
    static const char *const bad[] = {"12,5", "-1", "10001", "nan", "1 2", "0x10", "OK"};
    struct scripted s;
    struct gon_error err;
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct session *z = begin(&s);
        answer(1, "x?", bad[i]);
        session_put(z, "x", 42);
        assert_int_equal(session_ask_one(z, "x", &err), GON_E_LINK);
        assert_non_null(strstr(err.text, "'x?' was answered"));
        assert_true(session_number(z, "x") == 42); // untouched
        session_free(z);
    }
}

static void a_condition_counts_once_its_values_are_known(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct session *z = begin(&s);
    answer(1, "x?", "500");
    assert_int_equal(session_ask_one(z, "x", &err), 0); // nobody said what most is
    session_put(z, "most", 100);
    assert_int_equal(session_ask_one(z, "x", &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "that cannot be"));
    session_put(z, "most", 1000);
    assert_int_equal(session_ask_one(z, "x", &err), 0);
    session_free(z);
}

static void a_time_stamp_that_repeats_is_an_old_answer(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct session *z = begin(&s);
    answer(1, "r?", "1,17.5");
    assert_int_equal(session_ask_one(z, "read", &err), 0);
    assert_int_equal(session_ask_one(z, "read", &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "once more"));
    answer(1, "r?", "1,17.6");
    assert_int_equal(session_ask_one(z, "read", &err), 0);
    session_free(z);
}

static void a_value_that_means_nothing_now_is_unknown(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct session *z = begin(&s);
    answer(1, "t?", "1,25.5");
    assert_int_equal(session_ask_one(z, "warm", &err), 0);
    assert_true(session_number(z, "temperature") == 25.5);
    answer(1, "t?", "0,25.5");
    assert_int_equal(session_ask_one(z, "warm", &err), 0);
    assert_true(isnan(session_number(z, "temperature")));
    assert_false(session_holds(z, "temperature < 100"));
    session_free(z);
}

static void hear_slowly(struct scripted *s, const char *command, int64_t t_ns)
{
    if (strcmp(command, "id?") == 0)
        scripted_say(s, "counter,007\r\n", t_ns + MS(5));
    else
        scripted_say(s, "7\r\n", t_ns + MS(800));
}

static void an_exchange_has_its_own_patience(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct session *z = begin_with(&s, HEAD VALUES FRAMING EXCHANGES, hear_slowly);
    const struct profile_asks slow = {.name = {"slow"}, .count = 1};
    assert_int_equal(session_ask_once(z, &slow, &err), 0);
    assert_true(session_number(z, "x") == 7);
    const struct profile_asks x = {.name = {"x"}, .count = 1};
    assert_int_equal(session_ask_once(z, &x, &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "no answer in 100 ms"));
    session_free(z);
}

static void a_setting_is_read_back(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct session *z = begin(&s);
    answer(1, "l ", "OK");
    answer(2, "l?", "12.505");
    session_put(z, "level", 12.5);
    assert_int_equal(session_send(z, "set_level", NULL, &err), 0);
    assert_true(session_number(z, "level") == 12.505); // as it is
    session_put(z, "level", 50);
    assert_int_equal(session_send(z, "set_level", NULL, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "refuses 'l 50.00' (level reads back 12.505"));
    session_put(z, "level", 101);
    const int before = s.heard;
    assert_int_equal(session_send(z, "set_level", NULL, &err), GON_E_INPUT);
    assert_int_equal(s.heard, before); // nothing was sent
    assert_true(isnan(session_number(z, "level")));
    session_free(z);
}

// The answer to a setting is lost: it is not sent again, the read-back tells.
static void a_setting_is_sent_once_when_only_its_answer_is_lost(void **state)
{
    static const char *const ways[] = {"set_level", "set_echoed"};
    struct scripted s;
    struct gon_error err;
    (void)state;
    for (int echoed = 0; echoed < 2; echoed++) {
        struct session *z = begin(&s);
        answer(1, "l?", "12.5");
        session_put(z, "level", 12.5);
        assert_int_equal(session_send(z, ways[echoed], NULL, &err), 0);
        assert_int_equal(s.heard, 2); // the setting without an answer, and "l?"
        session_free(z);
    }
    struct session *z = begin(&s);
    assert_int_equal(session_send(z, "go", NULL, &err), GON_E_LINK); // nothing reads it back
    assert_int_equal(s.heard, 1);
    session_free(z);
}

// The command itself gets lost step times.
static void hear_at_last(struct scripted *s, const char *command, int64_t t_ns)
{
    static char level[16];
    char text[32];
    if (s->heard == 1)
        snprintf(level, sizeof level, "1.00");
    if (strncmp(command, "l ", 2) == 0 && s->step-- > 0)
        return;
    if (strncmp(command, "l ", 2) == 0)
        snprintf(level, sizeof level, "%.10s", command + 2);
    snprintf(text, sizeof text, "%s\r\n", strcmp(command, "l?") == 0 ? level : "OK");
    scripted_say(s, text, t_ns + MS(5));
}

static void a_setting_that_did_not_arrive_is_sent_again(void **state)
{
    (void)state;
    for (int lost = 1; lost <= 3; lost++) {
        struct scripted s;
        struct gon_error err;
        struct session *z = begin_with(&s, HEAD VALUES FRAMING EXCHANGES, hear_at_last);
        s.step = lost;
        session_put(z, "level", 80);
        assert_int_equal(session_send(z, "set_level", NULL, &err), lost < 3 ? 0 : GON_E_LINK);
        if (lost < 3)
            assert_true(session_number(z, "level") == 80);
        else
            assert_non_null(strstr(err.text, "'l 80.00': no answer"));
        session_free(z);
    }
}

static void an_echo_of_something_else_is_a_refusal(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct session *z = begin(&s);
    answer(1, "e ", "3");
    session_put(z, "level", 2);
    assert_int_equal(session_send(z, "set_echoed", NULL, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "refuses 'e 2.00' (level reads back 3"));
    assert_true(isnan(session_number(z, "level")));
    answer(1, "e ", "2");
    session_put(z, "level", 2);
    const int before = s.heard;
    assert_int_equal(session_send(z, "set_echoed", NULL, &err), 0);
    assert_int_equal(s.heard, before + 1); // nothing more to be asked
    session_free(z);
}

static void refusals_mean_something(void **state)
{
    static const struct {
        const char *answer;
        int rc, means;
    } rows[] = {{"Error: interlock open", GON_E_REFUSED, PROFILE_OPEN_INTERLOCK},
                {"ERROR 17", GON_E_DEVICE, PROFILE_REFUSED},
                {"Busy, wait", GON_E_REFUSED, PROFILE_BUSY}};
    struct scripted s;
    struct gon_error err;
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct session *z = begin(&s);
        answer(1, "go", rows[i].answer);
        assert_int_equal(session_send(z, "go", NULL, &err), rows[i].rc);
        assert_int_equal(session_meaning(z), rows[i].means);
        assert_non_null(strstr(err.text, rows[i].answer));
        answer(1, "go", "OK");
        assert_int_equal(session_send(z, "go", NULL, &err), 0);
        assert_int_equal(session_meaning(z), PROFILE_FINE);
        session_free(z);
    }
}

static void hear_busy(struct scripted *s, const char *command, int64_t t_ns)
{
    (void)command;
    scripted_say(s, ++s->step < 4 ? "busy\r\n" : "OK\r\n", t_ns + MS(5));
}

static void busy_is_waited_out(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct session *z = begin_with(&s, HEAD VALUES FRAMING EXCHANGES, hear_busy);
    const int64_t start_ns = vline.clk.t_ns;
    assert_int_equal(session_send(z, "go", NULL, &err), 0);
    assert_int_equal(s.heard, 4);
    assert_true(vline.clk.t_ns - start_ns >= MS(300) && vline.clk.t_ns - start_ns < MS(400));
    vline_turn();
    assert_true(vline.longest_ns <= MS(101));
    session_free(z);
}

static void hear_errors(struct scripted *s, const char *command, int64_t t_ns)
{
    if (strcmp(command, "esr?") == 0)
        scripted_say(s, s->step-- > 0 ? "32\r\n" : "0\r\n", t_ns + MS(5));
}

static void an_error_queue_is_asked_and_emptied(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct session *z = begin_with(&s, HEAD VALUES FRAMING EXCHANGES, hear_errors);
    session_put(z, "level", 5);
    s.step = 0;
    assert_int_equal(session_send(z, "set_checked", NULL, &err), 0);
    assert_int_equal(s.heard, 2);
    s.step = 3;
    assert_int_equal(session_send(z, "set_checked", NULL, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "refuses 'c 5.00' (esr is 32 (unknown))"));
    assert_int_equal(s.heard, 2 + 1 + 4);
    session_free(z);
}

static void a_restart_is_told_once(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct session *z = begin(&s);
    answer(1, "esr?", "128");
    answer(2, "x?", "1");
    assert_false(session_restarted(z));
    assert_int_equal(session_ask_one(z, "errors", &err), 0);
    assert_int_equal(session_ask_one(z, "x", &err), 0);
    assert_true(session_restarted(z));
    assert_false(session_restarted(z));
    assert_int_equal(session_ask_one(z, "x", &err), 0); // esr is still known to be 128, but old
    assert_false(session_restarted(z));
    assert_int_equal(session_ask_one(z, "errors", &err), 0);
    assert_true(session_restarted(z));
    session_free(z);
}

// Another unit answers the question that gets into step: that is not the one it was.
static void it_gets_into_step_with_the_very_same_unit(void **state)
{
    struct scripted s;
    struct gon_error err;
    char title[80];
    (void)state;
    struct session *z = begin(&s);
    assert_int_equal(session_identify(z, title, sizeof title, &err), 0);
    assert_int_equal(session_ask_one(z, "x", &err), GON_E_LINK); // no answer: out of step
    answer(0, "id?", "counter,008");
    answer(1, "x?", "1");
    assert_int_equal(session_ask_one(z, "x", &err), GON_E_LINK);
    answer(0, "id?", "counter,007");
    assert_int_equal(session_ask_one(z, "x", &err), 0);
    session_free(z);
}

// Who it is then is for the caller to judge: it has to be heard first.
static void after_a_reopening_any_unit_may_answer(void **state)
{
    struct scripted s;
    struct gon_error err;
    char title[80];
    (void)state;
    struct session *z = begin(&s);
    assert_int_equal(session_identify(z, title, sizeof title, &err), 0);
    answer(0, "id?", "counter,008");
    answer(1, "x?", "1");
    assert_int_equal(session_reopen(z, &err), 0);
    s.heard = 0;
    assert_int_equal(session_ask_one(z, "x", &err), 0);
    assert_int_equal(s.heard, 1); // nothing else was asked before
    assert_int_equal(session_identify(z, title, sizeof title, &err), 0);
    assert_string_equal(title, "counter, serial 008");
    session_free(z);
}

static void an_unknown_name_is_an_error_and_nothing_is_sent(void **state)
{
    struct scripted s;
    struct gon_error err;
    (void)state;
    struct session *z = begin(&s);
    assert_int_equal(session_ask_one(z, "no_such", &err), GON_E_INPUT);
    assert_int_equal(session_send(z, "no_such", NULL, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "no exchange 'no_such'"));
    session_put(z, "no_such", 1); // as far as the profile has it
    session_put(z, "", 1);
    assert_int_equal(s.heard, 0);
    session_free(z);
}

static void a_bus_instrument_is_no_text_instrument(void **state)
{
    struct gon_error err;
    struct session *z = NULL;
    static struct profile p = {.name = "bus", .protocol = PROFILE_MODBUS};
    struct scripted s;
    (void)state;
    scripted_init(&s, "\r", hear);
    struct clk *clk = vline_begin(&s.port);
    assert_int_equal(session_open(&p, vline.link, clk, NULL, &z, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "Modbus bus"));
    assert_null(z);
}

// --- checksums: also changed digits are seen -----------------------------------------------------

#define SUMS                                                                                       \
    "checksum: { kind = \"crc\"; width = 16; polynomial = 0x1021; initial = 0xFFFF; before = "     \
    "\"*\"; };\n"

// Counts what it is asked, by the simulated instrument.
struct counting {
    struct port port; // first
    int asked;
};

static struct counting counting;

static void counting_feed(struct port *p, const uint8_t *bytes, size_t size, int64_t t_ns)
{
    uint8_t reply[PORT_REPLY_MOST];
    int64_t due_ns = t_ns;
    char text[32];
    if (memmem(bytes, size, "x?", 2)) {
        snprintf(text, sizeof text, "x = %d", ++counting.asked % 10000);
        profiled_do(text);
    }
    port_feed(&profiled.device.port, bytes, size, t_ns);
    for (size_t n; (n = port_take(&profiled.device.port, PORT_NEVER - 1, reply, &due_ns)) > 0;)
        port_send(p, reply, n, due_ns > t_ns ? due_ns : t_ns);
}

// How many of 5000 readings are wrong, with every kind of fault, changed bytes too.
static int wrong_of(const char *text, int *ret_good)
{
    static const struct port_ops ops = {counting_feed, scripted_nothing, scripted_hangup};
    struct session *z;
    struct gon_error err;
    char title[80];
    int wrong = 0;
    struct profile *p = profiles_parse(text);
    profiled_begin(p);
    memset(&counting, 0, sizeof counting);
    port_init(&counting.port, &ops);
    profiled.line.inner = &counting.port;
    if (session_open(p, vline.link, profiled.clk, NULL, &z, &err) < 0 ||
        session_identify(z, title, sizeof title, &err) < 0)
        fail_msg("%s", err.text);
    profiled.line.one_in = 10;
    profiled.line.late_most_ns = MS(340);
    profiled.line.double_most_ns = MS(40);
    print_message("seed %llu\n", (unsigned long long)profiled.line.dice);
    *ret_good = 0;
    for (int i = 0; i < 5000; i++) {
        if (session_ask_one(z, "x", &err) < 0)
            continue;
        ++*ret_good;
        wrong += session_number(z, "x") != counting.asked % 10000;
    }
    session_free(z);
    free(p);
    return wrong;
}

#define GAP                                                                                        \
    "framing: { end_out = \"\\r\"; end_in = \"\\r\\n\"; timeout_ms = 100; quiet_ms = 350; sync = " \
    "\"who\";\n  gap_ms = 50; };\n"
#define START                                                                                      \
    "simulate: { start = ( { value = \"id\"; is = \"counter\"; }, { value = \"serial\"; is = "     \
    "\"007\"; },\n  { value = \"most\"; is = \"10000\"; } ); };\n"

static void checksums_leave_no_wrong_value(void **state)
{
    int good, good_bare;
    (void)state;
    const int wrong = wrong_of(HEAD VALUES GAP SUMS EXCHANGES START, &good);
    const int bare = wrong_of(HEAD VALUES GAP EXCHANGES START, &good_bare);
    print_message("5000 readings: %d answered, %d wrong; without checksums %d, %d wrong\n", good,
                  wrong, good_bare, bare);
    assert_true(good > 4900);
    assert_int_equal(wrong, 0);
    assert_true(bare > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_says_who_it_is_and_is_refused_when_it_is_another),
        cmocka_unit_test(what_does_not_fit_is_asked_again_three_times),
        cmocka_unit_test(a_condition_counts_once_its_values_are_known),
        cmocka_unit_test(a_time_stamp_that_repeats_is_an_old_answer),
        cmocka_unit_test(a_value_that_means_nothing_now_is_unknown),
        cmocka_unit_test(an_exchange_has_its_own_patience),
        cmocka_unit_test(a_setting_is_read_back),
        cmocka_unit_test(a_setting_is_sent_once_when_only_its_answer_is_lost),
        cmocka_unit_test(a_setting_that_did_not_arrive_is_sent_again),
        cmocka_unit_test(an_echo_of_something_else_is_a_refusal),
        cmocka_unit_test(refusals_mean_something),
        cmocka_unit_test(busy_is_waited_out),
        cmocka_unit_test(an_error_queue_is_asked_and_emptied),
        cmocka_unit_test(a_restart_is_told_once),
        cmocka_unit_test(it_gets_into_step_with_the_very_same_unit),
        cmocka_unit_test(after_a_reopening_any_unit_may_answer),
        cmocka_unit_test(an_unknown_name_is_an_error_and_nothing_is_sent),
        cmocka_unit_test(a_bus_instrument_is_no_text_instrument),
        cmocka_unit_test(checksums_leave_no_wrong_value),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    free(profile);
    return failed;
}
