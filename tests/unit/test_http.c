// SPDX-License-Identifier: MIT
// uses: daemon base
// The server and its client share one thread and one event loop.
#include "daemon/http.h"

#include "daemon/listener.h"
#include "daemon/loop.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

struct world {
    char folder[40], path[60];
    struct listener *listener;
    struct loop *loop;
    struct events *events;
    struct http *http;
    uint64_t later; // ticket of a request left open
    char body[200]; // of the last request
    bool timed_out;
};

struct client {
    struct world *w;
    int fd;
    char text[40000]; // all that came
    size_t size;
    const char *until; // stop the loop when this was seen
    bool closed;
};

static struct http_reply request(void *ctx, const struct http_request *r, uint64_t ticket)
{
    struct world *w = ctx;
    snprintf(w->body, sizeof w->body, "%s", r->body);
    if (!strcmp(r->path, "/later")) {
        w->later = ticket;
        loop_quit(w->loop);
        return (struct http_reply){.status = HTTP_LATER};
    }
    if (!strcmp(r->path, "/events"))
        return (struct http_reply){.status = HTTP_STREAM};
    assert_int_equal(r->pid, getpid());
    if (!strcmp(r->path, "/text"))
        return (struct http_reply){.status = 200, .body = strdup("{}"), .type = "text/plain"};
    return (struct http_reply){.status = 200, .body = strdup("{\"ok\":true}")};
}

static void give_up(void *ctx)
{
    struct world *w = ctx;
    w->timed_out = true;
    loop_quit(w->loop);
}

static int set_up(void **state)
{
    struct world *w = calloc(1, sizeof *w);
    strcpy(w->folder, "/tmp/gonio-http-XXXXXX");
    assert_non_null(mkdtemp(w->folder));
    snprintf(w->path, sizeof w->path, "%s/s", w->folder);
    assert_int_equal(listener_open(w->path, &w->listener, NULL), 0);
    assert_non_null(w->loop = loop_new(NULL));
    w->events = events_new(16, 100000, 1);
    struct http_ports ports = {w, request};
    assert_non_null(w->http =
                        http_new(w->loop, listener_fd(w->listener), w->events, &ports, NULL, NULL));
    assert_int_equal(loop_every(w->loop, 20000, give_up, w, NULL), 0);
    *state = w;
    return 0;
}

static int tear_down(void **state)
{
    struct world *w = *state;
    http_free(w->http);
    loop_free(w->loop);
    listener_close(w->listener);
    events_free(w->events);
    assert_int_equal(rmdir(w->folder), 0); // socket and lock file are gone
    free(w);
    return 0;
}

static void receive(void *ctx)
{
    struct client *c = ctx;
    ssize_t n = recv(c->fd, c->text + c->size, sizeof c->text - 1 - c->size, MSG_DONTWAIT);
    if (n > 0)
        c->size += (size_t)n;
    c->text[c->size] = 0;
    if (n == 0) {
        c->closed = true;
        loop_remove(c->w->loop, c->fd);
    }
    if (n == 0 || (c->until && strstr(c->text, c->until)))
        loop_quit(c->w->loop);
}

static void client_open(struct client *c, struct world *w)
{
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    *c = (struct client){.w = w, .fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)};
    strcpy(a.sun_path, w->path);
    assert_int_equal(connect(c->fd, (struct sockaddr *)&a, sizeof a), 0);
    assert_int_equal(loop_add(w->loop, c->fd, receive, c, NULL), 0);
}

static void client_close(struct client *c)
{
    if (!c->closed)
        loop_remove(c->w->loop, c->fd);
    close(c->fd);
}

// Sends and runs the loop until the text comes, the server closes, or the loop is told to end.
static void talk(struct client *c, const char *send_text, const char *until)
{
    size_t size = strlen(send_text);
    c->until = until;
    assert_int_equal(send(c->fd, send_text, size, MSG_NOSIGNAL), size);
    loop_run(c->w->loop);
    assert_false(c->w->timed_out);
}

static void expect(struct world *w, const char *send_text, const char *status)
{
    struct client c;
    client_open(&c, w);
    talk(&c, send_text, "}");
    if (strncmp(c.text + 9, status, strlen(status)))
        fail_msg("wanted %s, got %.60s", status, c.text);
    client_close(&c);
}

static void a_body_arrives_whole(void **state)
{
    struct world *w = *state;
    expect(w, "POST /x HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\n\r\nhello", "200");
    assert_string_equal(w->body, "hello");
    expect(w,
           "POST /x HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: "
           "chunked\r\n\r\n2\r\nab\r\n1\r\nc\r\n0\r\n\r\n",
           "200");
    assert_string_equal(w->body, "abc");
}

static void a_reply_is_json_unless_it_says_otherwise(void **state)
{
    static const char *const cases[][2] = {
        {"/x", "\r\nContent-Type: application/json\r\n"},
        {"/text", "\r\nContent-Type: text/plain\r\n"},
    };
    struct world *w = *state;
    for (int i = 0; i < 2; i++) {
        struct client c;
        char ask[60];
        client_open(&c, w);
        snprintf(ask, sizeof ask, "GET %s HTTP/1.1\r\nHost: a\r\n\r\n", cases[i][0]);
        talk(&c, ask, "}");
        assert_non_null(strstr(c.text, cases[i][1]));
        client_close(&c);
    }
}

static void ambiguous_lengths_are_refused(void **state)
{
    struct world *w = *state;
    expect(w,
           "POST /x HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\nTransfer-Encoding: "
           "chunked\r\n\r\n0\r\n\r\n",
           "400");
    expect(w, "POST /x HTTP/1.1\r\nHost: a\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\nhello",
           "400");
}

static void large_bodies_are_refused(void **state)
{
    struct world *w = *state;
    expect(w, "POST /x HTTP/1.1\r\nHost: a\r\nContent-Length: 1048577\r\n\r\n",
           "413"); // before it is sent
    char *text = malloc(80000);
    int n = sprintf(text, "POST /x HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n%x\r\n",
                    70000);
    memset(text + n, 'x', 70000);
    strcpy(text + n + 70000, "\r\n0\r\n\r\n");
    expect(w, text, "413");
    n = sprintf(text, "POST /x HTTP/1.1\r\nHost: a\r\nContent-Length: 65537\r\n\r\n");
    memset(text + n, 'y', 65537);
    text[n + 65537] = 0;
    expect(w, text, "413"); // read to its end, so that the client is there for the answer
    n = sprintf(text, "POST /x HTTP/1.1\r\nHost: a\r\nContent-Length: 65536\r\n\r\n");
    memset(text + n, 'y', 65536);
    text[n + 65536] = 0;
    expect(w, text, "200");
    free(text);
}

static void large_headers_are_refused(void **state)
{
    struct world *w = *state;
    char text[10000];
    int n = sprintf(text, "GET /x HTTP/1.1\r\nHost: a\r\nX: ");
    memset(text + n, 'x', 8200);
    strcpy(text + n + 8200, "\r\n\r\n");
    expect(w, text, "431");
}

static void a_request_may_be_answered_later(void **state)
{
    struct world *w = *state;
    struct client c;
    client_open(&c, w);
    talk(&c, "GET /later HTTP/1.1\r\nHost: a\r\n\r\n", "}");
    assert_int_equal(c.size, 0);
    http_answer(w->http, w->later, 201, strdup("{\"id\":7}"));
    loop_run(w->loop);
    assert_false(w->timed_out);
    assert_memory_equal(c.text, "HTTP/1.1 201", 12);
    assert_non_null(strstr(c.text, "{\"id\":7}"));
    http_answer(w->http, w->later, 201, strdup("{}")); // a second answer goes nowhere
    client_close(&c);
}

static void an_open_request_is_answered_at_the_end(void **state)
{
    struct world *w = *state;
    struct client c;
    client_open(&c, w);
    talk(&c, "GET /later HTTP/1.1\r\nHost: a\r\n\r\n", "}");
    loop_remove(w->loop, c.fd);
    http_free(w->http);
    w->http = NULL;
    assert_true(recv(c.fd, c.text, sizeof c.text, 0) > 0);
    assert_memory_equal(c.text, "HTTP/1.1 503", 12);
    close(c.fd);
}

static void a_stream_replays_and_follows(void **state)
{
    struct world *w = *state;
    struct client c;
    for (int i = 0; i < 3; i++)
        events_add(w->events, "log", "{}");
    client_open(&c, w);
    talk(&c, "GET /events HTTP/1.1\r\nHost: a\r\nLast-Event-ID: 1\r\n\r\n", "id: 3\n");
    assert_non_null(strstr(c.text, "id: 2\n"));
    assert_null(strstr(c.text, "id: 1\n"));
    assert_non_null(strstr(c.text, "text/event-stream"));
    events_add(w->events, "state", "{\"run\":5}");
    http_wake(w->http);
    c.until = "\"run\":5}\n\n";
    loop_run(w->loop);
    assert_false(w->timed_out);
    assert_non_null(strstr(c.text, "id: 4\n"));
    client_close(&c);
}

static void a_slow_reader_is_told_what_it_lost(void **state)
{
    struct world *w = *state;
    struct client c;
    for (int i = 0; i < 40; i++) // the ring holds 16
        events_add(w->events, "log", "{}");
    client_open(&c, w);
    talk(&c, "GET /events HTTP/1.1\r\nHost: a\r\nLast-Event-ID: 10\r\n\r\n", "id: 40\n");
    assert_non_null(strstr(c.text, "{\"event\":\"lost\",\"first\":11,\"last\":24}"));
    assert_non_null(strstr(c.text, "id: 25\n"));
    client_close(&c);
}

static void the_ninth_stream_is_refused(void **state)
{
    struct world *w = *state;
    struct client c[9];
    for (int i = 0; i < 9; i++) {
        client_open(&c[i], w);
        talk(&c[i], "GET /events HTTP/1.1\r\nHost: a\r\n\r\n", i < 8 ? "retry" : "}");
        assert_memory_equal(c[i].text + 9, i < 8 ? "200" : "503", 3);
    }
    for (int i = 0; i < 9; i++)
        client_close(&c[i]);
}

static void the_thirty_third_connection_is_refused(void **state)
{
    struct world *w = *state;
    struct client *c = calloc(33, sizeof *c);
    for (int i = 0; i < 33; i++) {
        client_open(&c[i], w);
        talk(&c[i], "GET /x HTTP/1.1\r\nHost: a\r\n\r\n", "}");
        assert_memory_equal(c[i].text + 9, i < 32 ? "200" : "503", 3);
    }
    for (int i = 0; i < 33; i++)
        client_close(&c[i]);
    free(c);
}

static void a_second_daemon_is_refused_and_a_dead_ones_socket_replaced(void **state)
{
    struct world *w = *state;
    struct gon_error err;
    struct listener *second = NULL;
    char wanted[100];
    snprintf(wanted, sizeof wanted, "already running, pid %ld on %s", (long)getpid(), w->path);
    assert_int_equal(listener_open(w->path, &second, &err), GON_E_REFUSED);
    assert_non_null(strstr(err.text, wanted));

    char stale[80];
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    snprintf(stale, sizeof stale, "%s2", w->path);
    strcpy(a.sun_path, stale);
    int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&a, sizeof a), 0);
    close(fd);
    assert_int_equal(listener_open(stale, &second, &err), 0);
    struct stat st;
    assert_int_equal(stat(stale, &st), 0);
    assert_int_equal(st.st_mode & 0777, 0660);
    listener_close(second);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(a_body_arrives_whole),
        TEST(a_reply_is_json_unless_it_says_otherwise),
        TEST(ambiguous_lengths_are_refused),
        TEST(large_bodies_are_refused),
        TEST(large_headers_are_refused),
        TEST(a_request_may_be_answered_later),
        TEST(an_open_request_is_answered_at_the_end),
        TEST(a_stream_replays_and_follows),
        TEST(a_slow_reader_is_told_what_it_lost),
        TEST(the_ninth_stream_is_refused),
        TEST(the_thirty_third_connection_is_refused),
        TEST(a_second_daemon_is_refused_and_a_dead_ones_socket_replaced),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
