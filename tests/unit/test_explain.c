// SPDX-License-Identifier: MIT
// uses: cli campaign drivers fit model base
#include "cli/explain.h"

#include "cli/ports.h"
#include "drivers/transport_adapter.h"
#include "drivers/laser.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define PORTS "ports that exist: /dev/serial/by-id/usb-A"

static struct link link_of(const char *text, enum link_use use)
{
    struct link l;
    assert_int_equal(link_parse(text, use, &l, NULL), 0);
    return l;
}

static void assert_says(const struct finding *f, enum finding_level level, const char *what,
                        const char *why, const char *todo)
{
    assert_int_equal(f->level, level);
    if (!strstr(f->what, what))
        fail_msg("what: '%s' without '%s'", f->what, what);
    if (!strstr(f->why, why))
        fail_msg("why: '%s' without '%s'", f->why, why);
    if (!strstr(f->todo, todo))
        fail_msg("to do: '%s' without '%s'", f->todo, todo);
}

static void a_port_that_cannot_be_opened(void **state)
{
    static const struct {
        struct gon_error err;
        const char *what, *why, *todo;
    } cases[] = {
        {{GON_E_GONE, "/dev/x: no such port; is it plugged in?"},
         "no such port",
         "not plugged in",
         PORTS},
        {{GON_E_REFUSED, "/dev/x: permission denied; join the group 'dialout': sudo usermod -aG "
                         "dialout me, then log in again"},
         "/dev/x: permission denied",
         "may not read",
         "usermod -aG dialout me"},
        {{GON_E_REFUSED, "/dev/x: permission denied (mode 600, owner uid 0)"},
         "mode 600",
         "may not read",
         "chgrp dialout /dev/x"},
        {{GON_E_REFUSED, "/dev/x: in use by pid 12 (minicom); end that one first"},
         "in use by pid 12 (minicom)",
         "one program at a time",
         "end that one first"},
        {{GON_E_INPUT, "/dev/x: is not a serial port"}, "is not a serial port", "refuses", "dmesg"},
    };
    const struct link l = link_of("serial:/dev/x?baud=9600", LINK_TEXT);
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct finding f;
        explain_open(&f, &cases[i].err, &l, PORTS);
        assert_says(&f, FINDING_WRONG, cases[i].what, cases[i].why, cases[i].todo);
    }
}

static void a_host_that_cannot_be_reached(void **state)
{
    struct link l = link_of("tcp:box:4001", LINK_TEXT);
    struct gon_error err = {GON_E_GONE, "box: no address for this host (Name unknown)"};
    struct finding f;
    (void)state;
    explain_open(&f, &err, &l, PORTS);
    assert_says(&f, FINDING_WRONG, "no address", "name service", "spelling of 'box'");
    gon_fail(&err, GON_E_GONE, "box port 4001: %s; is it switched on?", strerror(ECONNREFUSED));
    explain_open(&f, &err, &l, PORTS);
    assert_says(&f, FINDING_WRONG, "box port 4001", "nothing listens", "port 4001");
    gon_fail(&err, GON_E_GONE, "box port 4001: %s; is it switched on?", strerror(ETIMEDOUT));
    explain_open(&f, &err, &l, PORTS);
    assert_says(&f, FINDING_WRONG, "box port 4001", "nothing answers", "ping box");
}

static void a_device_that_does_not_talk(void **state)
{
    static const struct {
        struct gon_error err;
        const char *why, *todo;
    } cases[] = {
        {{GON_E_LINK, "serial:/dev/x: 'l?': no answer in 150 ms"},
         "nobody answers",
         "19200 baud, parity N, 1 stop bit"},
        {{GON_E_LINK, "x: 'l?': unreadable bytes in the answer (wrong baud rate?): '\\xff'"},
         "not the words of a cobolt-05",
         "baud rate or parity"},
        {{GON_E_DEVICE, "x: is 'ACME', not an SR830"},
         "something else than a cobolt-05",
         "plugged in"},
        {{GON_E_DEVICE, "x: sends back the command 'l?'; turn its echo off"},
         "repeats",
         "turn its echo off"},
        {{GON_E_GONE, "x: unplugged (hung up)"}, "unplugged just now", "plug"},
    };
    const struct link l = link_of("serial:/dev/x?baud=19200", LINK_TEXT);
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct finding f;
        explain_talk(&f, &cases[i].err, &l, "cobolt-05");
        assert_says(&f, FINDING_WRONG, "x: ", cases[i].why, cases[i].todo);
    }
}

static void a_serial_server_is_not_a_cable(void **state)
{
    const struct link l = link_of("tcp:box:4001", LINK_TEXT);
    struct gon_error err = {GON_E_LINK, "tcp:box:4001: 'l?': no answer in 150 ms"};
    struct finding f;
    (void)state;
    explain_talk(&f, &err, &l, "cobolt-05");
    assert_says(&f, FINDING_WRONG, "no answer", "behind it", "server's baud rate");
    err = (struct gon_error){GON_E_GONE, "tcp:box:4001: the connection is broken (hung up)"};
    explain_talk(&f, &err, &l, "cobolt-05");
    assert_says(&f, FINDING_WRONG, "broken", "one at a time", "other program");
}

static void the_wrong_device_on_a_port_is_named(void **state)
{
    struct finding f;
    (void)state;
    explain_instead(&f, "SR830,s/n1", "detector", "laser", "serial:/dev/x");
    assert_says(&f, FINDING_WRONG,
                "serial:/dev/x: this is the detector (SR830,s/n1), the config expects the laser",
                "exchanged", "links of detector and laser");
}

static void a_silent_bus_is_not_a_silent_unit(void **state)
{
    const struct link rtu = link_of("modbus-rtu:/dev/x?baud=9600&stop=2", LINK_MODBUS);
    const struct link tcp = link_of("modbus-tcp:box", LINK_MODBUS);
    struct finding f;
    (void)state;
    explain_unit(&f, 3, "1, 2");
    assert_says(&f, FINDING_WRONG, "unit 3 does not answer, while units 1, 2 on the same bus do",
                "address switch", "address switch to 3");
    explain_unit(&f, 3, "1");
    assert_says(&f, FINDING_WRONG, "while unit 1 on the same bus does", "power", "cable");
    explain_bus(&f, &rtu, "modbus-rtu:/dev/x", "1, 2");
    assert_says(&f, FINDING_WRONG, "nobody answers on this bus (asked: unit 1, 2)", "A and B",
                "9600 baud, parity E, 2 stop bits");
    explain_bus(&f, &tcp, "modbus-tcp:box", "1");
    assert_says(&f, FINDING_WRONG, "nobody answers", "gateway is reached", "wired to the gateway");
}

static void what_keeps_a_laser_dark_is_told(void **state)
{
    static const struct {
        struct laser_status status;
        const char *what, *todo;
    } cases[] = {
        {{.state = LASER_OFF, .interlock_closed = false}, "interlock is open", "close it"},
        {{.state = LASER_INTERLOCK, .interlock_closed = true}, "interlock is open", "key"},
        {{.state = LASER_NEEDS_KEY, .interlock_closed = true}, "wants its key", "off and on"},
        {{.state = LASER_FAULT, .interlock_closed = true, .fault_code = 1}, "fault 1: hot", "cool"},
    };
    const struct laser_status good = {.state = LASER_OFF, .interlock_closed = true};
    struct finding f;
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_true(explain_laser(&f, &cases[i].status, "hot"));
        assert_says(&f, FINDING_WRONG, cases[i].what, "", cases[i].todo);
    }
    assert_false(explain_laser(&f, &good, ""));
    explain_emission(&f);
    assert_says(&f, FINDING_WRONG, "LASER MAY BE ON", "ignores OFF", "key or the interlock");
    explain_relit(&f);
    assert_says(&f, FINDING_WRONG, "switched off again", "else", "beam");
}

static void a_lost_home_and_an_alarm(void **state)
{
    struct finding f;
    (void)state;
    explain_home(&f);
    assert_says(&f, FINDING_LOOK, "does not know its home", "lost its power", "a run homes it");
    explain_alarm(&f, 0x30, "overload");
    assert_says(&f, FINDING_WRONG, "alarm 30h: overload", "refuses to move", "reset the alarm");
    explain_no_reference(&f);
    assert_says(&f, FINDING_WRONG, "no reference", "chopper", "UNLOCK");
}

static void nothing_is_left_of_the_finding_before(void **state)
{
    struct finding f;
    (void)state;
    explain_home(&f);
    explain_well(&f, "unit %d", 3);
    assert_int_equal(f.level, FINDING_WELL);
    assert_string_equal(f.what, "unit 3");
    assert_string_equal(f.why, "");
    assert_string_equal(f.todo, "");
}

static void ports_are_listed_by_their_lasting_names(void **state)
{
    char folder[] = "/tmp/gonio-ports-XXXXXX", path[80], text[200];
    (void)state;
    assert_non_null(mkdtemp(folder));
    ports_text(folder, NULL, 0, text, sizeof text);
    assert_non_null(strstr(text, "no USB serial adapter is plugged in"));
    static const char *const names[] = {"usb-B", "usb-A"};
    for (int i = 0; i < 2; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        fclose(fopen(path, "w"));
    }
    ports_text(folder, NULL, 0, text, sizeof text);
    char expected[200];
    snprintf(expected, sizeof expected, "ports that exist: %s/usb-A, %s/usb-B", folder, folder);
    assert_string_equal(text, expected);
    ports_text(folder, NULL, 0, text, 60); // as many as fit
    assert_string_equal(text + strlen(text) - 5, "usb-A");
    for (int i = 0; i < 2; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        unlink(path);
    }
    static const struct adapter adapters[] = {{"/dev/ttyUSB0", 0x0403, 0x6001, "A1"},
                                              {"/dev/ttyACM0", 0x2341, 0x0043, ""}};
    ports_text(folder, adapters, 2, text, sizeof text);
    assert_string_equal(text, "ports that exist: usb-0403:6001:A1 (/dev/ttyUSB0), usb-2341:0043 "
                              "(/dev/ttyACM0)");
    rmdir(folder);
    ports_text(folder, NULL, 0, text, sizeof text);
    assert_non_null(strstr(text, "no USB serial adapter"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_port_that_cannot_be_opened),
        cmocka_unit_test(a_host_that_cannot_be_reached),
        cmocka_unit_test(a_device_that_does_not_talk),
        cmocka_unit_test(a_serial_server_is_not_a_cable),
        cmocka_unit_test(the_wrong_device_on_a_port_is_named),
        cmocka_unit_test(a_silent_bus_is_not_a_silent_unit),
        cmocka_unit_test(what_keeps_a_laser_dark_is_told),
        cmocka_unit_test(a_lost_home_and_an_alarm),
        cmocka_unit_test(nothing_is_left_of_the_finding_before),
        cmocka_unit_test(ports_are_listed_by_their_lasting_names),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
