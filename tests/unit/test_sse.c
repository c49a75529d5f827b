// SPDX-License-Identifier: MIT
// uses: cli campaign drivers fit model base
#include "cli/sse.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <string.h>

static char seen[500];

static void event(void *ctx, const struct sse_event *e)
{
    (void)ctx;
    size_t n = strlen(seen);
    snprintf(seen + n, sizeof seen - n, "[%s|%s|%s]", e->kind, e->id, e->data);
}

static const char stream[] = ": a comment\nretry: 1000\n\n"
                             "id: 7\nevent: reading\ndata: {\"a\":1}\n\n"
                             "data: one\r\ndata:two\r\n\r\n"
                             "event: nothing\n\n" // no data: no event
                             "id: 8\rdata\rdata: x\r\r"
                             "data: unfinished";
static const char wanted[] = "[reading|7|{\"a\":1}][message|7|one\ntwo][message|8|\nx]";

static void events_come_whole_wherever_the_bytes_are_cut(void **state)
{
    (void)state;
    for (size_t cut = 1; cut < sizeof stream; cut++) {
        struct sse *s = sse_new(event, NULL);
        *seen = 0;
        for (size_t at = 0; at < sizeof stream - 1; at += cut) {
            size_t left = sizeof stream - 1 - at;
            assert_int_equal(sse_feed(s, stream + at, left < cut ? left : cut), 0);
        }
        assert_string_equal(seen, wanted);
        assert_string_equal(sse_last_id(s), "8");
        sse_free(s);
    }
}

static void a_broken_connection_leaves_nothing_half_read(void **state)
{
    (void)state;
    struct sse *s = sse_new(event, NULL);
    *seen = 0;
    sse_feed(s, "id: 3\ndata: whole\n\nid: 4\nevent: x\ndata: ha", 43);
    sse_reconnected(s);
    sse_feed(s, "data: new\n\n", 11);
    assert_string_equal(seen, "[message|3|whole][message|3|new]");
    sse_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(events_come_whole_wherever_the_bytes_are_cut),
        cmocka_unit_test(a_broken_connection_leaves_nothing_half_read),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
