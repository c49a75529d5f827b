// SPDX-License-Identifier: MIT
// uses: drivers base
// What the guard is told of each laser's profile, and which answers it takes for off.
#include "drivers/safing.h"
#include "drivers/profile.h"
#include "tests/unit/profiles.h"

#include <regex.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static struct guard_record record_of(const char *name, const char *link)
{
    struct guard_record r;
    struct gon_error err = {0};
    if (safing_of(profiles_get(name), link, &r, &err) < 0)
        fail_msg("%s", err.text);
    return r;
}

static bool matches(const char *expression, const char *line)
{
    regex_t regex;
    assert_int_equal(regcomp(&regex, expression, REG_EXTENDED | REG_ICASE | REG_NOSUB), 0);
    const bool is = regexec(&regex, line, 0, NULL, 0) == 0;
    regfree(&regex);
    return is;
}

static void assert_bytes(const struct guard_bytes *b, const char *text)
{
    assert_int_equal(b->size, strlen(text));
    assert_memory_equal(b->at, text, b->size);
}

static void assert_off(const struct guard_ask *a, const char *const *off,
                       const char *const *not_off)
{
    for (; *off; off++)
        if (!matches(a->off, *off))
            fail_msg("'%s' is off: %s", *off, a->off);
    for (; *not_off; not_off++)
        if (matches(a->off, *not_off))
            fail_msg("'%s' is not off: %s", *not_off, a->off);
}

#define LIST(...) ((const char *const[]){__VA_ARGS__, NULL})

static void a_cobolt(void **state)
{
    (void)state;
    const struct guard_record r = record_of("cobolt-05", "serial:/dev/ttyUSB0?baud=115200");
    assert_string_equal(r.link, "serial:/dev/ttyUSB0?baud=115200");
    assert_true(r.gap_ns == 100000000 && r.timeout_ns == 150000000 && r.quiet_ns == 350000000);
    assert_false(r.framed || r.tail || r.brief);
    assert_int_equal(r.offs, 2);
    assert_bytes(&r.off[0], "\rl0\r");
    assert_bytes(&r.off[1], "\r@cob0\r");
    assert_int_equal(r.ons, 2);
    assert_bytes(&r.on[0], "@cob1");
    assert_bytes(&r.on[1], "l1");
    assert_bytes(&r.end_out, "\r");
    assert_bytes(&r.end_in, "\r\n");
    assert_int_equal(r.asks, 2);
    assert_bytes(&r.ask[0].question, "l?\r");
    assert_off(&r.ask[0], LIST("0", " 0 ", "00", "+0", "0\r"),
               LIST("1", "", " ", "OK", "01", "10", "-0.5", "0.5", "Error: 0", "0 0", "l?"));
    assert_bytes(&r.ask[1].question, "gom?\r");
    // 1, 2 and 3 are on their way; beyond 8 nobody knows.
    assert_off(&r.ask[1], LIST("0", "4", "5", "6", "7", "8", "04"),
               LIST("1", "2", "3", "9", "40", "44", "", "OK", "Syntax error: 0"));
}

static void a_coherent(void **state)
{
    (void)state;
    const struct guard_record r = record_of("coherent-obis", "tcp:127.0.0.1:4000");
    assert_bytes(&r.off[0], "\r\nSOUR:AM:STAT OFF\r\n");
    assert_bytes(&r.on[0], "SOUR:AM:STAT ON");
    assert_off(&r.ask[0], LIST("OFF", "off", " OFF "), LIST("ON", "OK", "", "OFFON", "OFF 1"));
    assert_off(&r.ask[1], LIST("C8001008", "0", "08", "c8001008", "0xC8001008", "CC000008"),
               LIST("C8001002", "C8001010", "12", "2", "10", "C800101A", "", "OK", "ON",
                    "C8001008G", "C8001008 2", "1C8001002"));
}

static void a_laser_quantum(void **state)
{
    (void)state;
    const struct guard_record r = record_of("laser-quantum", "serial:/dev/ttyUSB0");
    assert_bytes(&r.off[1], "\r\nSHUTTER CLOSE\r\n");
    assert_bytes(&r.on[0], "ON");
    assert_off(&r.ask[0], LIST("DISABLED", "disabled\r"), LIST("ENABLED", "DISABLE", "", "Error"));
}

static void over_usb_off_begins_with_nothing_else(void **state)
{
    (void)state;
    struct profile *p = malloc(sizeof *p);
    struct guard_record r;
    *p = *profiles_get("coherent-obis");
    strcpy(p->laser.off[0], "SOUR:AM:STAT OFF");
    assert_int_equal(safing_of(p, "usbtmc:1313:804a", &r, NULL), 0);
    assert_true(r.framed);
    assert_bytes(&r.off[0], "SOUR:AM:STAT OFF\r\n");
    assert_int_equal(safing_of(p, "serial:/dev/x", &r, NULL), 0);
    assert_bytes(&r.off[0], "\r\nSOUR:AM:STAT OFF\r\n"); // half a command must not swallow it
    free(p);
}

static void checksums_are_sent_and_of_answers_cut_off(void **state)
{
    (void)state;
    struct profile *p = malloc(sizeof *p);
    struct guard_record r;
    *p = *profiles_get("cobolt-05");
    p->checksum = (struct profile_checksum){
        .kind = PROFILE_XOR, .width = 8, .form = PROFILE_HEX_UPPER, .before = "*"};
    assert_int_equal(safing_of(p, "serial:/dev/x", &r, NULL), 0);
    assert_bytes(&r.ask[0].question, "l?*53\r"); // 0x6c ^ 0x3f
    assert_int_equal(r.tail, 3);
    free(p);
}

static void an_echo_stands_before_the_answer(void **state)
{
    (void)state;
    struct profile *p = malloc(sizeof *p);
    struct guard_record r;
    *p = *profiles_get("cobolt-05");
    strcpy(p->framing.echo_end, "\r");
    assert_int_equal(safing_of(p, "serial:/dev/x", &r, NULL), 0);
    assert_off(&r.ask[0], LIST("l?\r0"), LIST("0", "l?\r1", "l\r0"));
    strcpy(p->framing.echo_end, "\r\n"); // a line of its own
    assert_int_equal(safing_of(p, "serial:/dev/x", &r, NULL), 0);
    assert_off(&r.ask[0], LIST("0"), LIST("l?", "l?\r1"));
    free(p);
}

// Every pattern's parts: what may miss, what is not kept, signs that mean something elsewhere.
static void what_stands_around_a_value_is_expected(void **state)
{
    (void)state;
    struct profile *p = malloc(sizeof *p);
    struct guard_record r;
    *p = *profiles_get("cobolt-05");
    strcpy(p->exchanges[profile_exchange(p, "emission")].answer, "[(EM.) ]{emission:d} of {{{}}}");
    assert_int_equal(safing_of(p, "serial:/dev/x", &r, NULL), 0);
    assert_off(&r.ask[0], LIST("(EM.) 0 of {7}", "0of{}", "(EM.)0 of {x y}"),
               LIST("(EMx) 0 of {7}", "(EM.) 1 of {7}", "0", "0 of 7"));
    free(p);
}

static void refused(const char *is_off, const char *says)
{
    struct profile *p = malloc(sizeof *p);
    struct guard_record r = {.offs = 77};
    struct gon_error err = {0};
    *p = *profiles_get("cobolt-05");
    snprintf(p->laser.is_off, sizeof p->laser.is_off, "%s", is_off);
    strcpy(p->laser.off_asks.name[0], "emission");
    strcpy(p->laser.off_asks.name[2], "power");
    strcpy(p->laser.off_asks.name[3], "model");
    p->laser.off_asks.count = 4;
    assert_int_equal(safing_of(p, "serial:/dev/x", &r, &err), GON_E_INPUT);
    if (!strstr(err.text, says) || !strstr(err.text, "cobolt-05"))
        fail_msg("%s: '%s'", is_off, err.text);
    assert_int_equal(r.offs, 77);
    free(p);
}

static void what_the_guard_cannot_judge_is_refused(void **state)
{
    (void)state;
    refused("power_w < 0.001", "power_w");
    refused("model ~ 'x*'", "model");
    refused("emission = mode", "compare two values");
    refused("emission = 2", "no answer can mean off");
    refused("emission = 0 and fault = 0", "which no question of off_asks brings");

    struct profile *p = malloc(sizeof *p);
    struct guard_record r;
    struct gon_error err = {0};
    *p = *profiles_get("coherent-obis");
    strcpy(p->laser.is_off, "status has 0x08 and emission = OFF");
    assert_int_equal(safing_of(p, "serial:/dev/x", &r, &err), GON_E_INPUT);
    assert_non_null(strstr(err.text, "missing bits"));
    strcpy(p->laser.is_off, "not status.emission and status >= 8 and emission = OFF");
    assert_int_equal(safing_of(p, "serial:/dev/x", &r, &err), GON_E_INPUT);
    free(p);
}

static void a_laser_that_nothing_switches_on_cannot_be_watched(void **state)
{
    (void)state;
    struct profile *p = malloc(sizeof *p);
    struct guard_record r;
    struct gon_error err = {0};
    *p = *profiles_get("cobolt-05");
    p->laser.on.count = 0;
    assert_int_equal(safing_of(p, "serial:/dev/x", &r, &err), GON_E_INPUT);
    assert_int_equal(safing_of(profiles_get("sr830"), "serial:/dev/x", &r, &err), GON_E_INPUT);
    assert_int_equal(safing_of(profiles_get("cobolt-05"), "serial", &r, &err), GON_E_INPUT);
    free(p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cobolt),
        cmocka_unit_test(a_coherent),
        cmocka_unit_test(a_laser_quantum),
        cmocka_unit_test(over_usb_off_begins_with_nothing_else),
        cmocka_unit_test(checksums_are_sent_and_of_answers_cut_off),
        cmocka_unit_test(an_echo_stands_before_the_answer),
        cmocka_unit_test(what_stands_around_a_value_is_expected),
        cmocka_unit_test(what_the_guard_cannot_judge_is_refused),
        cmocka_unit_test(a_laser_that_nothing_switches_on_cannot_be_watched),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
