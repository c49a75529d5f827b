// SPDX-License-Identifier: MIT
// uses: daemon campaign drivers fit model base
#include "daemon/metrics.h"

#include "daemon/instrument.h"
#include "daemon/queue.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PART_THETA_I, PART_THETA_R, PART_SAMPLE }; // the axes of this bench, in its order

#define BUS "modbus-rtu:/dev/bus?baud=115200&parity=E"

static void part(struct instrument_snapshot *s, int i, const char *name, const char *address,
                 enum part_link link)
{
    s->part[i].name = name;
    s->part[i].driver = "driver";
    s->part[i].address = address;
    s->part[i].link = link;
    if (i < INSTRUMENT_AXES)
        s->axis[i].unit = "deg";
}

static struct instrument_snapshot bench(void)
{
    struct instrument_snapshot s = {.signal_v = 0.25, .monitor_v = (double)NAN};
    for (int i = 0; i < PART_COUNT; i++)
        part(&s, i, "", "", PART_ABSENT);
    part(&s, PART_THETA_I, "theta_i", BUS, PART_LOST);
    part(&s, PART_THETA_R, "theta_r", BUS, PART_OK);
    part(&s, PART_SAMPLE, "sample", "", PART_ABSENT);
    part(&s, PART_LASER, "laser", "serial:/dev/l", PART_OK);
    part(&s, PART_DETECTOR, "detector", "tcp:d:1", PART_LOST);
    part(&s, PART_DEVICES, "nd", "serial:/dev/w", PART_OK);
    part(&s, PART_DEVICES + 1, "door", BUS, PART_OK);
    snprintf(s.device[0].position, sizeof s.device[0].position, "2");
    s.device[0].use = BENCH_FILTER;
    s.device[1] =
        (struct device_state){.use = BENCH_INPUTS,
                              .values = 2,
                              .value = {{"open", "", 1}, {"bench_c", "degC", (double)NAN}}};
    s.axis[PART_THETA_I].position = (double)NAN;
    s.axis[PART_THETA_R].position = -12.5;
    s.laser.power_w = (double)NAN;
    s.laser.interlock_closed = true;
    return s;
}

static char *text_of(const struct instrument_snapshot *s, const struct run *run)
{
    const struct metrics_source m = {.uptime_s = 1.5, .readings = 7, .run = run, .snapshot = s};
    char *text = metrics_text(&m);
    assert_non_null(text);
    return text;
}

static void assert_has(const char *text, const char *line)
{
    char whole[300];
    snprintf(whole, sizeof whole, "\n%s\n", line);
    if (!strstr(text, whole))
        fail_msg("no line '%s' in:\n%s", line, text);
}

static void values_are_lines_and_unknown_ones_are_left_out(void **state)
{
    struct instrument_snapshot s = bench();
    char *text = text_of(&s, NULL);
    (void)state;
    assert_has(text, "gonio_build_info{version=\"" GONIO_VERSION "\"} 1");
    assert_has(text, "gonio_uptime_seconds 1.5");
    assert_has(text, "# TYPE gonio_readings_total counter");
    assert_has(text, "gonio_readings_total 7");
    assert_has(text, "gonio_axis_position{axis=\"theta_r\",unit=\"deg\"} -12.5");
    assert_has(text, "gonio_device_up{device=\"theta_i\",driver=\"driver\",link=\"" BUS "\"} 0");
    assert_has(text, "gonio_detector_signal_volts 0.25");
    assert_has(text, "gonio_selector_position{device=\"nd\",position=\"2\"} 1");
    assert_has(text, "gonio_input_value{device=\"door\",value=\"open\",unit=\"\"} 1");
    assert_null(strstr(text, "bench_c"));
    assert_has(text, "gonio_laser_interlock_closed 1");
    assert_null(strstr(text, "nan"));
    assert_null(strstr(text, "axis=\"theta_i\",unit"));
    assert_null(strstr(text, "\"sample\""));
    assert_null(strstr(text, "\ngonio_laser_power_watts "));
    free(text);
}

static void light_is_said_unless_it_is_known_to_be_off(void **state)
{
    struct instrument_snapshot s = bench();
    (void)state;
    char *text = text_of(&s, NULL);
    assert_has(text, "gonio_laser_emission 0");
    free(text);
    s.part[PART_LASER].link = PART_LOST; // nobody knows
    text = text_of(&s, NULL);
    assert_has(text, "gonio_laser_emission 1");
    free(text);
}

static void a_run_has_one_state(void **state)
{
    struct instrument_snapshot s = bench();
    const struct run run = {.id = 15, .state = RUN_PAUSED, .done = 3, .total = 850};
    (void)state;
    char *text = text_of(&s, &run);
    assert_has(text, "gonio_run_state{state=\"paused\"} 1");
    assert_has(text, "gonio_run_state{state=\"running\"} 0");
    assert_has(text, "gonio_run_state{state=\"idle\"} 0");
    assert_has(text, "gonio_run_number 15");
    assert_has(text, "gonio_run_readings_done 3");
    free(text);
    text = text_of(&s, NULL);
    assert_has(text, "gonio_run_state{state=\"idle\"} 1");
    free(text);
}

static int count(const char *text, const char *word)
{
    int n = 0;
    for (; (text = strstr(text, word)); text += strlen(word))
        n++;
    return n;
}

static void a_link_that_parts_share_is_told_once(void **state)
{
    struct instrument_snapshot s = bench();
    s.part[PART_THETA_I].stats.requests = s.part[PART_THETA_R].stats.requests = 42;
    s.part[PART_THETA_I].stats.errors[LINK_SILENT] = 4;
    char *text = text_of(&s, NULL);
    (void)state;
    assert_has(text, "gonio_link_up{link=\"" BUS "\"} 1"); // one of its units answers
    assert_has(text, "gonio_link_up{link=\"tcp:d:1\"} 0");
    assert_has(text, "gonio_link_requests_total{link=\"" BUS "\"} 42");
    assert_has(text, "gonio_link_errors_total{link=\"" BUS "\",kind=\"silent\"} 4");
    assert_int_equal(count(text, "\ngonio_link_requests_total{"), 4);
    assert_int_equal(count(text, "\ngonio_link_errors_total{"), 4 * LINK_ERRORS);
    free(text);
}

static void buckets_add_up_to_the_count(void **state)
{
    struct instrument_snapshot s = bench();
    struct link_stats *stats = &s.part[PART_LASER].stats;
    link_stats_answer(stats, 1500000);
    link_stats_answer(stats, 1500000);
    link_stats_answer(stats, 30000000);
    link_stats_answer(stats, 20000000000);
    char *text = text_of(&s, NULL);
    (void)state;
#define LASER "{link=\"serial:/dev/l\""
    assert_has(text, "# TYPE gonio_link_latency_seconds histogram");
    assert_has(text, "gonio_link_latency_seconds_bucket" LASER ",le=\"1e-05\"} 0");
    assert_has(text, "gonio_link_latency_seconds_bucket" LASER ",le=\"0.001\"} 0");
    assert_has(text, "gonio_link_latency_seconds_bucket" LASER ",le=\"0.002\"} 2");
    assert_has(text, "gonio_link_latency_seconds_bucket" LASER ",le=\"0.05\"} 3");
    assert_has(text, "gonio_link_latency_seconds_bucket" LASER ",le=\"10\"} 3");
    assert_has(text, "gonio_link_latency_seconds_bucket" LASER ",le=\"+Inf\"} 4");
    assert_has(text, "gonio_link_latency_seconds_count" LASER "} 4");
    assert_has(text, "gonio_link_latency_seconds_sum" LASER "} 20.033");
    free(text);
}

static void labels_are_escaped(void **state)
{
    struct instrument_snapshot s = bench();
    s.part[PART_LASER].address = "serial:/dev/\"a\\b\nc";
    char *text = text_of(&s, NULL);
    (void)state;
    assert_has(text, "gonio_link_up{link=\"serial:/dev/\\\"a\\\\b\\nc\"} 1");
    free(text);
}

static void before_the_bench_was_looked_at_only_the_daemon_is_told(void **state)
{
    char *text = text_of(NULL, NULL);
    (void)state;
    assert_has(text, "gonio_readings_total 7");
    assert_null(strstr(text, "laser"));
    assert_null(strstr(text, "\ngonio_instrument_age_seconds "));
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_are_lines_and_unknown_ones_are_left_out),
        cmocka_unit_test(light_is_said_unless_it_is_known_to_be_off),
        cmocka_unit_test(a_run_has_one_state),
        cmocka_unit_test(a_link_that_parts_share_is_told_once),
        cmocka_unit_test(buckets_add_up_to_the_count),
        cmocka_unit_test(labels_are_escaped),
        cmocka_unit_test(before_the_bench_was_looked_at_only_the_daemon_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
