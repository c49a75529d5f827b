// SPDX-License-Identifier: MIT
// uses: guard drivers base
// The daemon's end of the guard, with the real guard behind it: its decisions (guard/guard.c) run
// on a thread of this program, in front of a laser that is a few lines long.
#include "drivers/guard_link.h"
#include "drivers/transport.h"
#include "guard/guard.h"

#include <poll.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <cmocka.h>

#define LONG_S 20.0 // for what should be there at once

struct peer { // one life of a guard
    int fd;
    pthread_t thread;
    struct guard guard;
    bool over;
};

static struct {
    struct peer peer[4];
    int lives;
    int ends[4]; // ours
    atomic_bool light, ignores_off, mute, unplugged, deaf;
    atomic_int offs;
} bench;

static void step(struct peer *p, struct guard_event e);

static void laser_hears(struct peer *p, const char *line, size_t size)
{
    const char *says = "Syntax error\r\n";
    if (size > 0 && *line == '\r')
        line++, size--;
    if (strncmp(line, "l0\r", size) == 0) {
        bench.offs++;
        bench.light = bench.light && bench.ignores_off;
        says = "OK\r\n";
    } else if (strncmp(line, "l1\r", size) == 0) {
        bench.light = true;
        says = "OK\r\n";
    } else if (strncmp(line, "l?\r", size) == 0) {
        says = bench.light ? "1\r\n" : "0\r\n";
    }
    if (!bench.mute)
        step(p, (struct guard_event){GUARD_ON_BYTES, says, strlen(says), false, 0, ""});
}

static void carry_out(struct peer *p, const struct guard_act *a)
{
    struct guard_event e = {.kind = GUARD_ON_DONE, .text = ""};
    if (bench.unplugged)
        e = (struct guard_event){.kind = GUARD_ON_DONE, .code = GON_E_GONE, .text = "x: unplugged"};
    switch (a->kind) {
    case GUARD_OPEN: e.kind = GUARD_ON_OPENED; break;
    case GUARD_WRITE: break;
    case GUARD_TELL: send(p->fd, a->bytes, a->size, MSG_NOSIGNAL); return;
    case GUARD_END: p->over = true; return;
    default: return;
    }
    step(p, e);
    if (a->kind == GUARD_WRITE && !bench.unplugged)
        laser_hears(p, a->bytes, a->size);
}

static void step(struct peer *p, struct guard_event e)
{
    struct guard_acts acts;
    guard_step(&p->guard, clk_now_ns(clk_system()), &e, &acts);
    for (int i = 0; i < acts.count; i++)
        carry_out(p, &acts.act[i]);
}

static void *live(void *ctx)
{
    struct peer *p = ctx;
    char bytes[sizeof(struct guard_record) + 1];
    while (!p->over) {
        struct pollfd f = {p->fd, POLLIN, 0};
        if (poll(&f, 1, 1) > 0 && !bench.deaf) {
            const ssize_t n = recv(p->fd, bytes, sizeof bytes, 0);
            struct guard_event e = {.kind = GUARD_ON_GONE};
            if (n > 0)
                e = (struct guard_event){
                    .kind = GUARD_ON_MESSAGE, .bytes = bytes, .size = (size_t)n};
            step(p, e);
            if (n <= 0)
                break;
        }
        if (bench.deaf && p != &bench.peer[bench.lives - 1])
            break; // was replaced
        step(p, (struct guard_event){.kind = GUARD_ON_TIME});
    }
    close(p->fd);
    return NULL;
}

static int connect_to(void *ctx, struct gon_error *err)
{
    (void)ctx;
    (void)err;
    int ends[2];
    assert_true(bench.lives < 4);
    struct peer *p = &bench.peer[bench.lives];
    assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends), 0);
    guard_init(&p->guard);
    p->fd = ends[1];
    bench.ends[bench.lives++] = ends[0];
    if (bench.lives > 1)
        bench.deaf = false;
    assert_int_equal(pthread_create(&p->thread, NULL, live, p), 0);
    return ends[0];
}

static struct guard_bytes bytes_of(const char *text)
{
    struct guard_bytes b = {.size = (uint8_t)strlen(text)};
    memcpy(b.at, text, b.size);
    return b;
}

static struct transport *begin(struct guard_link **ret_link)
{
    const struct guard_host host = {.connect = connect_to};
    const struct guard_record r = {
        .link = "tcp:laser:1",
        .end_out = bytes_of("\r"),
        .end_in = bytes_of("\r\n"),
        .gap_ns = CLK_MS(2),
        .timeout_ns = CLK_MS(30),
        .quiet_ns = CLK_MS(5),
        .reopen_ns = CLK_MS(20),
        .offs = 1,
        .ons = 1,
        .asks = 1,
        .off = {bytes_of("\rl0\r")},
        .on = {bytes_of("l1")},
        .ask = {{bytes_of("l?\r"), "^0$"}},
    };
    struct transport *t = NULL;
    struct gon_error err = {0};
    memset(&bench, 0, sizeof bench);
    *ret_link = guard_link_new(&host, &r, clk_system());
    if (transport_open_guarded(*ret_link, r.link, clk_system(), &t, &err) < 0)
        fail_msg("%s", err.text);
    return t;
}

static void end(struct transport *t, struct guard_link *g)
{
    bench.unplugged = bench.ignores_off = bench.mute = bench.deaf = false;
    transport_close(t);
    guard_link_free(g);
    for (int i = 0; i < bench.lives; i++) {
        close(bench.ends[i]);
        pthread_join(bench.peer[i].thread, NULL);
    }
    assert_false(bench.light);
}

static int64_t in_s(double s)
{
    return clk_now_ns(clk_system()) + CLK_S(s);
}

static void ask(struct transport *t, const char *command, const char *answer)
{
    char text[100] = "";
    size_t have = 0;
    assert_int_equal(transport_drain(t, 0, NULL) < 0, 0);
    assert_int_equal(transport_write(t, command, strlen(command), in_s(LONG_S), NULL), 0);
    while (!strstr(text, "\r\n")) {
        const int n = transport_read(t, text + have, sizeof text - 1 - have, in_s(LONG_S), NULL);
        assert_true(n > 0);
        have += (size_t)n;
    }
    assert_string_equal(text, answer);
}

static void off_is_read_back_by_the_guard_and_commands_pass(void **state)
{
    (void)state;
    struct guard_link *g;
    struct gon_error err;
    bench.light = true;
    struct transport *t = begin(&g);
    assert_int_equal(guard_link_off(g, in_s(LONG_S), &err), 0);
    const int offs = bench.offs;
    assert_true(offs >= 2);
    ask(t, "l?\r", "0\r\n");
    ask(t, "p?\r", "Syntax error\r\n");
    assert_int_equal(guard_link_watch(g, &err), 0);
    assert_int_equal(bench.offs, offs);
    assert_int_equal(transport_write(t, "l", 1, in_s(LONG_S), &err), GON_E_INPUT);
    assert_int_equal(transport_read(t, &(char){0}, 1, in_s(0.01), &err), GON_E_LINK);
    char much[GUARD_DATA + 1] = {0};
    assert_int_equal(transport_write(t, much, sizeof much, in_s(LONG_S), &err), GON_E_INPUT);
    assert_true(transport_stats(t)->bytes_out > 0 && transport_stats(t)->bytes_in > 0);
    end(t, g);
}

static void a_lease_is_renewed_or_the_link_is_told_why_not(void **state)
{
    (void)state;
    struct guard_link *g;
    struct gon_error err;
    struct transport *t = begin(&g);
    assert_int_equal(guard_link_off(g, in_s(LONG_S), NULL), 0);
    ask(t, "l1\r", "OK\r\n");
    for (int i = 0; i < 14; i++) {
        guard_link_renew(g);
        clk_sleep(clk_system(), CLK_MS(50), NULL);
    }
    assert_int_equal(guard_link_watch(g, &err), 0); // 0.7 s later
    assert_true(bench.light);
    for (const int64_t until_ns = in_s(LONG_S); clk_now_ns(clk_system()) < until_ns && bench.light;)
        clk_sleep(clk_system(), CLK_MS(5), NULL);
    assert_int_equal(guard_link_watch(g, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "0.5 s"));
    assert_int_equal(transport_write(t, "l?\r", 3, in_s(LONG_S), &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, "tcp:laser:1: the guard switched the laser off"));
    assert_int_equal(guard_link_off(g, in_s(LONG_S), NULL), 0);
    assert_int_equal(guard_link_watch(g, &err), 0);
    ask(t, "l?\r", "0\r\n");
    end(t, g);
}

static void what_hinders_off_is_said(void **state)
{
    (void)state;
    struct guard_link *g;
    struct gon_error err;
    struct transport *t = begin(&g);
    assert_int_equal(guard_link_off(g, in_s(LONG_S), NULL), 0);
    ask(t, "l1\r", "OK\r\n");
    bench.ignores_off = true;
    assert_int_equal(guard_link_off(g, in_s(0.3), &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "LASER MAY BE ON"));
    assert_int_equal(transport_write(t, "l?\r", 3, in_s(LONG_S), &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "LASER MAY BE ON"));
    bench.mute = true;
    assert_int_equal(guard_link_off(g, in_s(0.3), &err), GON_E_LINK);
    assert_int_equal(transport_write(t, "l?\r", 3, in_s(LONG_S), &err), GON_E_LINK);
    bench.unplugged = true;
    clk_sleep(clk_system(), CLK_MS(200), NULL); // it notices when it writes
    assert_int_equal(guard_link_off(g, in_s(0.3), &err), GON_E_GONE);
    assert_int_equal(transport_write(t, "l?\r", 3, in_s(LONG_S), &err), GON_E_GONE);
    assert_int_equal(transport_write(t, "l?\r", 3, in_s(LONG_S), &err), GON_E_GONE);
    assert_non_null(strstr(err.text, "not open since"));
    assert_int_equal(transport_reopen(t, &err), GON_E_GONE);
    bench.unplugged = bench.mute = bench.ignores_off = false;
    assert_int_equal(transport_reopen(t, &err), 0);
    assert_int_equal(guard_link_off(g, in_s(LONG_S), NULL), 0);
    ask(t, "l?\r", "0\r\n");
    assert_int_equal(bench.lives, 1);
    end(t, g);
}

static void a_guard_that_is_gone_is_replaced_by_the_next_off(void **state)
{
    (void)state;
    struct guard_link *g;
    struct gon_error err;
    struct transport *t = begin(&g);
    assert_int_equal(guard_link_off(g, in_s(LONG_S), NULL), 0);
    ask(t, "l1\r", "OK\r\n");
    shutdown(bench.ends[0], SHUT_RDWR);
    assert_int_equal(guard_link_watch(g, &err), GON_E_DEVICE);
    assert_non_null(strstr(err.text, "gonio-guard"));
    assert_int_equal(transport_write(t, "l?\r", 3, in_s(LONG_S), &err), GON_E_GONE);
    assert_int_equal(guard_link_off(g, in_s(LONG_S), NULL), 0);
    assert_int_equal(bench.lives, 2);
    assert_false(bench.light);
    assert_int_equal(transport_reopen(t, &err), 0);
    assert_int_equal(guard_link_off(g, in_s(LONG_S), NULL), 0);
    ask(t, "l?\r", "0\r\n");
    end(t, g);
}

static void one_that_does_not_answer_is_replaced_too(void **state)
{
    (void)state;
    struct guard_link *g;
    struct gon_error err;
    struct transport *t = begin(&g);
    assert_int_equal(guard_link_off(g, in_s(LONG_S), NULL), 0);
    bench.deaf = true;
    assert_int_equal(transport_write(t, "l?\r", 3, in_s(0), &err), GON_E_GONE);
    assert_int_equal(transport_reopen(t, &err), 0);
    assert_int_equal(bench.lives, 2);
    assert_int_equal(guard_link_off(g, in_s(LONG_S), NULL), 0);
    end(t, g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(off_is_read_back_by_the_guard_and_commands_pass),
        cmocka_unit_test(a_lease_is_renewed_or_the_link_is_told_why_not),
        cmocka_unit_test(what_hinders_off_is_said),
        cmocka_unit_test(a_guard_that_is_gone_is_replaced_by_the_next_off),
        cmocka_unit_test(one_that_does_not_answer_is_replaced_too),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
