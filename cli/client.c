// SPDX-License-Identifier: MIT
#include "cli/client.h"

#include "base/clk.h"
#include "base/paths.h"
#include "cli/sse.h"

#include <curl/curl.h>
#include <jansson.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/un.h>

enum {
    MOST_REPLY = 16 * 1024 * 1024,
    REQUEST_S = 30,
    SILENCE_S = 35, // the daemon pings every 10 s
    RETRY_MS = 500
};
#define GRACE_NS CLK_S(2) // for the answer to what was asked before an interrupt

struct client {
    char socket[sizeof(((struct sockaddr_un *)NULL)->sun_path)];
    CURL *curl;
    int interrupt_fd;
    int64_t interrupted_ns; // when it was seen first; 0: not yet
};

struct reply {
    char *text;
    size_t size;
};

int client_new(const char *socket, struct client **ret_client, struct gon_error *err)
{
    struct client *c = calloc(1, sizeof *c);
    if (c)
        c->interrupt_fd = -1;
    int rc = !c         ? gon_fail(err, GON_E_SYSTEM, "out of memory")
             : !socket  ? paths_socket(c->socket, sizeof c->socket, err)
                        : paths_socket_fits(socket, err);
    if (rc == 0 && socket)
        snprintf(c->socket, sizeof c->socket, "%s", socket);
    if (rc == 0 && !(c->curl = curl_easy_init()))
        rc = gon_fail(err, GON_E_SYSTEM, "libcurl does not start");
    if (rc < 0) {
        client_free(c);
        return rc;
    }
    *ret_client = c;
    return GON_OK;
}

void client_free(struct client *c)
{
    if (!c)
        return;
    curl_easy_cleanup(c->curl);
    free(c);
}

const char *client_socket(const struct client *c)
{
    return c->socket;
}

void client_interrupt_by(struct client *c, int fd)
{
    c->interrupt_fd = fd;
}

static int no_daemon(const struct client *c, CURLcode code, struct gon_error *err)
{
    if (code == CURLE_COULDNT_CONNECT)
        return gon_fail(err, GON_E_GONE,
                        "no daemon at %s; start it: goniod --sim (or goniod --config goniod.cfg)",
                        c->socket);
    if (code == CURLE_ABORTED_BY_CALLBACK)
        return gon_fail(err, GON_E_CANCELED,
                        "interrupted; the daemon at %s has not answered, and may do it all the "
                        "same; see: gonio status",
                        c->socket);
    return gon_fail(err, GON_E_GONE, "the daemon at %s does not answer: %s; see: gonio status",
                    c->socket, curl_easy_strerror(code));
}

static void prepare(struct client *c, const char *path)
{
    char url[300];
    snprintf(url, sizeof url, "http://goniod%s", path);
    curl_easy_reset(c->curl);
    curl_easy_setopt(c->curl, CURLOPT_URL, url);
    curl_easy_setopt(c->curl, CURLOPT_UNIX_SOCKET_PATH, c->socket);
    curl_easy_setopt(c->curl, CURLOPT_PROXY, "");
    curl_easy_setopt(c->curl, CURLOPT_NOSIGNAL, 1L);
}

// --- requests -----------------------------------------------------------------------------------

static size_t take_reply(char *data, size_t one, size_t size, void *ctx)
{
    struct reply *r = ctx;
    size *= one;
    char *text = r->size + size > MOST_REPLY ? NULL : realloc(r->text, r->size + size + 1);
    if (!text)
        return 0;
    r->text = text;
    memcpy(text + r->size, data, size);
    r->size += size;
    text[r->size] = 0;
    return size;
}

static enum gon_code code_of(long status)
{
    switch (status) {
    case 400: case 404: case 413: case 422: return GON_E_INPUT;
    case 409: case 429: case 503: return GON_E_REFUSED;
    default: return GON_E_SYSTEM;
    }
}

static int refused(long status, const json_t *reply, struct gon_error *err)
{
    const char *error = NULL, *where = NULL, *next = NULL;
    json_unpack((json_t *)reply, "{s?s, s?s, s?s}", "error", &error, "where", &where, "what_to_do",
                &next);
    if (!error)
        return gon_fail(err, code_of(status), "the daemon answered with HTTP status %ld", status);
    return gon_fail(err, code_of(status), "%s%s%s%s%s", where ? where : "", where ? ": " : "",
                    error, next ? "; " : "", next ? next : "");
}

static int understand(long status, const struct reply *r, json_t **ret_reply, struct gon_error *err)
{
    json_error_t e;
    json_t *reply = json_loadb(r->text ? r->text : "", r->size, JSON_REJECT_DUPLICATES, &e);
    int rc = GON_OK;
    if (status < 200 || status > 299)
        rc = refused(status, reply, err);
    else if (!reply)
        rc = gon_fail(err, GON_E_SYSTEM, "the daemon's answer is no JSON: line %d column %d: %s",
                      e.line, e.column, e.text);
    if (rc < 0)
        json_decref(reply);
    else
        *ret_reply = reply;
    return rc;
}

static bool readable(int fd)
{
    struct pollfd p = {fd, POLLIN, 0};
    return fd >= 0 && poll(&p, 1, 0) > 0;
}

// Called by libcurl at least once a second.
static int give_up(void *ctx, curl_off_t a, curl_off_t b, curl_off_t c_, curl_off_t d)
{
    struct client *c = ctx;
    (void)a, (void)b, (void)c_, (void)d;
    if (!readable(c->interrupt_fd))
        return 0;
    const int64_t now_ns = clk_now_ns(clk_system());
    if (!c->interrupted_ns)
        c->interrupted_ns = now_ns;
    return now_ns - c->interrupted_ns > GRACE_NS;
}

// Who asks, for the daemon's control.
static struct curl_slist *add_name(struct client *c, struct curl_slist *headers)
{
    char name[65], line[300];
    paths_person(name, sizeof name);
    char *escaped = *name ? curl_easy_escape(c->curl, name, 0) : NULL;
    if (!escaped)
        return headers;
    snprintf(line, sizeof line, "Gonio-Name: %s", escaped);
    curl_free(escaped);
    return curl_slist_append(headers, line);
}

int client_request(struct client *c, const char *method, const char *path, const json_t *body,
                   json_t **ret_reply, struct gon_error *err)
{
    struct reply r = {0};
    char *text = body ? json_dumps(body, JSON_COMPACT) : strdup("");
    struct curl_slist *headers =
        add_name(c, curl_slist_append(NULL, "Content-Type: application/json"));
    prepare(c, path);
    curl_easy_setopt(c->curl, CURLOPT_CUSTOMREQUEST, method);
    if (strcmp(method, "GET")) {
        curl_easy_setopt(c->curl, CURLOPT_POSTFIELDS, text);
        curl_easy_setopt(c->curl, CURLOPT_HTTPHEADER, headers);
    }
    curl_easy_setopt(c->curl, CURLOPT_TIMEOUT, (long)REQUEST_S);
    curl_easy_setopt(c->curl, CURLOPT_WRITEFUNCTION, take_reply);
    curl_easy_setopt(c->curl, CURLOPT_WRITEDATA, &r);
    curl_easy_setopt(c->curl, CURLOPT_NOPROGRESS, 0L);
    curl_easy_setopt(c->curl, CURLOPT_XFERINFOFUNCTION, give_up);
    curl_easy_setopt(c->curl, CURLOPT_XFERINFODATA, c);
    CURLcode code = curl_easy_perform(c->curl);
    long status = 0;
    curl_easy_getinfo(c->curl, CURLINFO_RESPONSE_CODE, &status);
    int rc = code ? no_daemon(c, code, err) : understand(status, &r, ret_reply, err);
    curl_slist_free_all(headers);
    free(text);
    free(r.text);
    return rc;
}

// --- events -------------------------------------------------------------------------------------

struct follow {
    const struct client_follower *follower;
    struct sse *sse;
    struct reply refusal;
    CURL *curl;
    bool enough, away;
};

static void take_event(void *ctx, const struct sse_event *event)
{
    struct follow *f = ctx;
    json_t *o = f->enough ? NULL : json_loads(event->data, JSON_REJECT_DUPLICATES, NULL);
    if (o && !f->follower->event(f->follower->ctx, o))
        f->enough = true;
    json_decref(o);
}

static size_t take_stream(char *data, size_t one, size_t size, void *ctx)
{
    struct follow *f = ctx;
    long status = 0;
    curl_easy_getinfo(f->curl, CURLINFO_RESPONSE_CODE, &status);
    if (status != 200)
        return take_reply(data, one, size, &f->refusal);
    if (f->away)
        f->enough = !f->follower->back(f->follower->ctx);
    f->away = false;
    return sse_feed(f->sse, data, one * size) < 0 || f->enough ? 0 : one * size;
}

// One connection: until the follower has enough, an interrupt, or its end (ret_code, ret_status).
static int stream_once(CURLM *multi, CURL *curl, int interrupt_fd, CURLcode *ret_code,
                       long *ret_status)
{
    int running = 1;
    curl_multi_add_handle(multi, curl);
    while (running && !readable(interrupt_fd)) {
        struct curl_waitfd extra = {interrupt_fd, CURL_WAIT_POLLIN, 0};
        if (curl_multi_perform(multi, &running) || !running)
            break;
        curl_multi_poll(multi, &extra, interrupt_fd >= 0, 1000, NULL);
    }
    int left;
    for (CURLMsg *m; (m = curl_multi_info_read(multi, &left));)
        if (m->msg == CURLMSG_DONE)
            *ret_code = m->data.result;
    curl_easy_getinfo(curl, CURLINFO_RESPONSE_CODE, ret_status);
    curl_multi_remove_handle(multi, curl);
    return running ? GON_E_CANCELED : GON_OK;
}

static struct curl_slist *stream_headers(const char *last_id)
{
    char line[80];
    snprintf(line, sizeof line, "Last-Event-ID: %s", last_id);
    struct curl_slist *l = curl_slist_append(NULL, "Accept: text/event-stream");
    return *last_id ? curl_slist_append(l, line) : l;
}

static int connect_once(struct client *c, CURLM *multi, struct follow *f, const char *last_id,
                        int interrupt_fd, struct gon_error *err)
{
    CURLcode code = CURLE_OK;
    long status = 0;
    const char *seen = *sse_last_id(f->sse) ? sse_last_id(f->sse) : last_id;
    struct curl_slist *headers = stream_headers(seen);
    prepare(c, "/api/v1/events");
    curl_easy_setopt(c->curl, CURLOPT_HTTPHEADER, headers);
    curl_easy_setopt(c->curl, CURLOPT_WRITEFUNCTION, take_stream);
    curl_easy_setopt(c->curl, CURLOPT_WRITEDATA, f);
    curl_easy_setopt(c->curl, CURLOPT_LOW_SPEED_LIMIT, 1L);
    curl_easy_setopt(c->curl, CURLOPT_LOW_SPEED_TIME, (long)SILENCE_S);
    sse_reconnected(f->sse);
    f->refusal.size = 0;
    int rc = stream_once(multi, c->curl, interrupt_fd, &code, &status);
    curl_slist_free_all(headers);
    if (rc < 0)
        return gon_fail(err, GON_E_CANCELED, "interrupted");
    if (status && status != 200) {
        json_t *none = NULL;
        return understand(status, &f->refusal, &none, err);
    }
    if (code)
        no_daemon(c, code, err);
    return GON_OK;
}

// The follower's clock is the machine's; an interrupt ends the pause.
static void pause_for(int interrupt_fd)
{
    struct pollfd p = {interrupt_fd, POLLIN, 0};
    poll(&p, 1, RETRY_MS);
}

int client_follow(struct client *c, const char *last_id, int interrupt_fd,
                  const struct client_follower *follower, struct gon_error *err)
{
    struct follow f = {.follower = follower, .curl = c->curl};
    CURLM *multi = curl_multi_init();
    f.sse = sse_new(take_event, &f);
    int64_t away_since_ns = 0;
    int rc = multi && f.sse ? GON_OK : gon_fail(err, GON_E_SYSTEM, "out of memory");
    while (rc == GON_OK && !f.enough) {
        bool was_away = f.away;
        rc = connect_once(c, multi, &f, last_id, interrupt_fd, err);
        if (rc < 0 || f.enough)
            break;
        if (!f.away) {
            follower->away(follower->ctx);
            away_since_ns = clk_now_ns(clk_system());
            f.away = true;
        } else if (was_away && clk_now_ns(clk_system()) - away_since_ns > CLIENT_AWAY_NS) {
            rc = gon_fail(err, GON_E_GONE,
                          "the daemon at %s went away; start it again, then see: gonio list",
                          c->socket);
        }
        pause_for(interrupt_fd);
    }
    curl_multi_cleanup(multi);
    sse_free(f.sse);
    free(f.refusal.text);
    return rc;
}
