// SPDX-License-Identifier: MIT
// uses: daemon base
#include "daemon/events.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <string.h>

static void an_event_has_the_streams_syntax(void **state)
{
    (void)state;
    struct event_view v;
    struct events *e = events_new(4, 10000, 7);
    assert_int_equal(events_last_id(e), 6);
    assert_false(events_after(e, 0, &v));
    assert_int_equal(events_add(e, "state", "{\"run\":1}"), 7);
    assert_int_equal(events_add(e, "log", "{}"), 8);
    assert_true(events_after(e, 0, &v));
    assert_string_equal(v.text,
                        "id: 7\nevent: state\ndata: {\"event\":\"state\",\"id\":7,\"run\":1}\n\n");
    assert_int_equal(v.size, strlen(v.text));
    assert_true(events_after(e, 7, &v));
    assert_string_equal(v.text, "id: 8\nevent: log\ndata: {\"event\":\"log\",\"id\":8}\n\n");
    assert_false(events_after(e, 8, &v));
    assert_false(events_after(e, 99, &v)); // an id from the future is nobody's
    events_free(e);
}

static void the_oldest_go_when_the_ring_is_full(void **state)
{
    (void)state;
    struct event_view v;
    struct events *e = events_new(3, 100000, 1);
    for (int i = 0; i < 10; i++)
        events_add(e, "log", "{}");
    assert_int_equal(events_oldest_id(e), 8);
    assert_true(events_after(e, 2, &v)); // 3..7 are lost: the next is the oldest kept
    assert_int_equal(v.id, 8);
    assert_true(events_after(e, 8, &v));
    assert_int_equal(v.id, 9);
    events_free(e);
}

static void bytes_are_bounded_too(void **state)
{
    (void)state;
    char data[200] = "{\"text\":\"";
    memset(data + strlen(data), 'x', 100);
    strcat(data, "\"}");
    struct events *e = events_new(1000, 1000, 1);
    for (int i = 0; i < 50; i++)
        events_add(e, "log", data);
    uint64_t kept = events_last_id(e) - events_oldest_id(e) + 1;
    assert_true(kept >= 5 && kept <= 7); // about 150 bytes each
    struct event_view v;
    assert_true(events_after(e, 49, &v));
    assert_int_equal(v.id, 50);
    events_free(e);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_event_has_the_streams_syntax),
        cmocka_unit_test(the_oldest_go_when_the_ring_is_full),
        cmocka_unit_test(bytes_are_bounded_too),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
