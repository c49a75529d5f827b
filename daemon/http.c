// SPDX-License-Identifier: MIT
#include "daemon/http.h"

#include "base/log.h"
#include "daemon/loop.h"
#include "daemon/stream.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <microhttpd.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum {
    MOST_CONNECTIONS = 32,
    SPARE_CONNECTIONS = 480, // silent ones, those that are told so, and whoever wants to stop
    MOST_STREAMS = 8,
    MOST_BODY = 64 * 1024,
    MOST_SWALLOWED = 1024 * 1024, // of a body that is too large, before the connection is cut
    MOST_HEADER = 8 * 1024,
    CONNECTION_MEMORY = 32 * 1024,
    SILENCE_S = 12, // longer than PING_MS
    PING_MS = 10000
};

enum stage { READING, WAITING, ANSWERED, SENT };

struct exchange { // one request and its answer
    struct exchange *next;
    struct http *http;
    struct MHD_Connection *connection;
    enum stage stage;
    uint64_t ticket;
    char *body;
    size_t size, swallowed;
    struct http_reply reply;
    struct stream *stream;
    int watched_fd; // whose hang-up the loop reports; -1: none
};

struct http {
    struct MHD_Daemon *mhd;
    struct loop *loop;
    const struct events *events;
    struct http_ports ports;
    struct log *log;
    int epoll_fd, connections, streams;
    bool stopping;
    uint64_t next_ticket;
    struct exchange *exchanges;
};

char *http_error(const char *error, const char *where, const char *what_to_do)
{
    json_t *o =
        json_pack("{s:s, s:s*, s:s}", "error", error, "where", where, "what_to_do", what_to_do);
    char *text = o ? json_dumps(o, JSON_COMPACT) : NULL;
    json_decref(o);
    return text ? text : strdup("{\"error\":\"out of memory\",\"what_to_do\":\"try again\"}");
}

static struct http_reply refuse(int status, const char *error, const char *what_to_do)
{
    return (struct http_reply){.status = status, .body = http_error(error, NULL, what_to_do)};
}

// --- before the body is read --------------------------------------------------------------------

struct framing {
    int lengths, encodings;
    unsigned long long length;
};

static enum MHD_Result count_framing(void *cls, enum MHD_ValueKind kind, const char *key,
                                     const char *value)
{
    struct framing *f = cls;
    (void)kind;
    if (!strcasecmp(key, "Content-Length")) {
        f->lengths++;
        f->length = value ? strtoull(value, NULL, 10) : 0;
    }
    if (!strcasecmp(key, "Transfer-Encoding"))
        f->encodings++;
    return MHD_YES;
}

// A reply with a status when the request is refused before its body.
// A stop is for everybody, however many others there are.
static struct http_reply check_header(struct http *h, struct MHD_Connection *c, const char *path)
{
    struct framing f = {0};
    MHD_get_connection_values(c, MHD_HEADER_KIND, count_framing, &f);
    const union MHD_ConnectionInfo *size =
        MHD_get_connection_info(c, MHD_CONNECTION_INFO_REQUEST_HEADER_SIZE);
    if (f.lengths + f.encodings > 1)
        return refuse(
            400, "the request gives its length more than once (Content-Length, Transfer-Encoding)",
            "send one of them");
    if (h->connections > MOST_CONNECTIONS && strcmp(path, HTTP_STOP_PATH) != 0)
        return refuse(503, "too many connections (32)", "close some and try again");
    if (size && size->header_size > MOST_HEADER)
        return refuse(431, "the request's header is larger than 8 KiB",
                      "send fewer or shorter header lines");
    if (f.length > MOST_SWALLOWED) // less is read to its end: the client is there for the answer
        return refuse(413, "the request's body is larger than 64 KiB", "send a smaller one");
    return (struct http_reply){0};
}

// --- answers ------------------------------------------------------------------------------------

static enum MHD_Result send_reply(struct exchange *x)
{
    struct MHD_Response *r = MHD_create_response_from_buffer(strlen(x->reply.body), x->reply.body,
                                                             MHD_RESPMEM_MUST_FREE);
    if (!r)
        return MHD_NO;
    x->reply.body = NULL;
    x->stage = SENT;
    MHD_add_response_header(r, "Content-Type", x->reply.type ? x->reply.type : "application/json");
    MHD_add_response_header(r, "Cache-Control", "no-store");
    if (x->reply.allow)
        MHD_add_response_header(r, "Allow", x->reply.allow);
    if (x->reply.status == 503)
        MHD_add_response_header(r, "Connection", "close");
    enum MHD_Result done = MHD_queue_response(x->connection, (unsigned)x->reply.status, r);
    MHD_destroy_response(r);
    return done;
}

// The id after which a client wants to go on: of the header, else only what is new.
static int last_seen(struct exchange *x, uint64_t *ret_id)
{
    const char *text = MHD_lookup_connection_value(x->connection, MHD_HEADER_KIND, "Last-Event-ID");
    char *end = NULL;
    *ret_id = events_last_id(x->http->events);
    if (!text || !*text)
        return GON_OK;
    errno = 0;
    unsigned long long id = strtoull(text, &end, 10);
    if (errno || *end || *text < '0' || *text > '9')
        return GON_E_INPUT;
    *ret_id = id;
    return GON_OK;
}

static int descriptor(struct MHD_Connection *c)
{
    const union MHD_ConnectionInfo *info =
        MHD_get_connection_info(c, MHD_CONNECTION_INFO_CONNECTION_FD);
    return info ? info->connect_fd : -1;
}

// The client went away, or will send no more: something to send tells which.
static void stream_hung_up(void *ctx)
{
    struct exchange *x = ctx;
    loop_remove(x->http->loop, x->watched_fd);
    x->watched_fd = -1;
    stream_ping(x->stream);
}

static enum MHD_Result send_stream(struct exchange *x)
{
    uint64_t seen;
    if (x->http->streams >= MOST_STREAMS)
        x->reply = refuse(503, "too many event streams (8)", "stop one of the others that watch");
    else if (last_seen(x, &seen) < 0)
        x->reply =
            refuse(400, "Last-Event-ID is not a number", "send the id of the last event seen");
    else if (!(x->stream = stream_new(x->connection, x->http->events, seen)))
        x->reply = refuse(500, "out of memory", "try again");
    if (!x->stream)
        return send_reply(x);
    struct MHD_Response *r = stream_response(x->stream);
    if (!r)
        return MHD_NO;
    x->http->streams++;
    x->watched_fd = descriptor(x->connection);
    if (loop_add_hangup(x->http->loop, x->watched_fd, stream_hung_up, x, NULL) < 0)
        x->watched_fd = -1; // the next ping will notice
    x->stage = SENT;
    enum MHD_Result done = MHD_queue_response(x->connection, MHD_HTTP_OK, r);
    MHD_destroy_response(r);
    return done;
}

static enum MHD_Result answer(struct exchange *x)
{
    if (x->reply.status == HTTP_STREAM)
        return send_stream(x);
    if (x->reply.status == HTTP_LATER) {
        x->stage = WAITING;
        MHD_suspend_connection(x->connection);
        return MHD_YES;
    }
    return x->reply.body ? send_reply(x) : MHD_NO;
}

// --- requests -----------------------------------------------------------------------------------

static enum MHD_Result take_body(struct exchange *x, const char *data, size_t *size)
{
    size_t n = *size;
    *size = 0;
    x->swallowed += n;
    if (x->swallowed > MOST_BODY)
        return x->swallowed > MOST_SWALLOWED ? MHD_NO : MHD_YES;
    char *body = realloc(x->body, x->size + n + 1);
    if (!body)
        return MHD_NO;
    x->body = body;
    memcpy(body + x->size, data, n);
    x->size += n;
    body[x->size] = 0;
    return MHD_YES;
}

static void peer_of(struct MHD_Connection *c, struct http_request *ret_request)
{
    struct ucred who;
    socklen_t size = sizeof who;
    ret_request->pid = ret_request->uid = -1;
    if (getsockopt(descriptor(c), SOL_SOCKET, SO_PEERCRED, &who, &size) == 0) {
        ret_request->pid = who.pid;
        ret_request->uid = (long)who.uid;
    }
}

static bool is_printable(const char *text)
{
    for (; *text; text++)
        if ((unsigned char)*text < 0x20 || *text == 0x7f)
            return false;
    return true;
}

// What is said of a name is JSON, which is UTF-8; one that is none could not even be shown.
static bool is_utf8(const char *text)
{
    json_t *o = json_string(text);
    json_decref(o);
    return o != NULL;
}

// False: it is there, and is no name.
static bool name_of(struct MHD_Connection *c, char ret_name[HTTP_NAME])
{
    char decoded[3 * HTTP_NAME];
    const char *text = MHD_lookup_connection_value(c, MHD_HEADER_KIND, HTTP_NAME_HEADER);
    *ret_name = 0;
    if (!text)
        return true;
    if (strlen(text) >= sizeof decoded)
        return false;
    memcpy(decoded, text, strlen(text) + 1);
    const size_t size = MHD_http_unescape(decoded);
    if (size >= HTTP_NAME || size != strlen(decoded) || !is_printable(decoded) ||
        !is_utf8(decoded))
        return false;
    memcpy(ret_name, decoded, size + 1);
    return true;
}

static struct http_reply handle(struct exchange *x, const char *method, const char *path)
{
    if (x->swallowed > MOST_BODY)
        return refuse(413, "the request's body is larger than 64 KiB", "send a smaller one");
    if (x->http->stopping)
        return refuse(503, "the daemon is ending", "start it again");
    struct http_request r = {
        .method = method, .path = path, .body = x->body ? x->body : "", .size = x->size};
    char name[HTTP_NAME];
    peer_of(x->connection, &r);
    r.name = name;
    // Who stops needs no name: a stop is not refused for a wrong one.
    if (!name_of(x->connection, name) && strcmp(path, HTTP_STOP_PATH))
        return refuse(400, "the header " HTTP_NAME_HEADER " is no name",
                      "send at most 64 printable bytes of UTF-8, percent-encoded; gonio takes "
                      "GONIO_NAME");
    log_say(x->http->log, strcmp(method, "GET") ? LOG_INFO : LOG_DEBUG, "http",
            "%s %s from pid %ld uid %ld", method, path, r.pid, r.uid);
    return x->http->ports.request(x->http->ports.ctx, &r, x->ticket);
}

static struct exchange *begin(struct http *h, struct MHD_Connection *c)
{
    struct exchange *x = calloc(1, sizeof *x);
    if (!x)
        return NULL;
    *x = (struct exchange){.next = h->exchanges,
                           .http = h,
                           .connection = c,
                           .ticket = ++h->next_ticket,
                           .watched_fd = -1};
    h->exchanges = x;
    return x;
}

static enum MHD_Result access_handler(void *cls, struct MHD_Connection *c, const char *path,
                                      const char *method, const char *version, const char *data,
                                      size_t *size, void **con_cls)
{
    struct http *h = cls;
    struct exchange *x = *con_cls;
    (void)version;
    if (!x) {
        if (!(x = *con_cls = begin(h, c)))
            return MHD_NO;
        x->reply = check_header(h, c, path);
        return x->reply.status ? send_reply(x) : MHD_YES;
    }
    if (*size)
        return take_body(x, data, size);
    if (x->stage == READING)
        x->reply = handle(x, method, path);
    else if (x->stage != ANSWERED)
        return MHD_YES;
    return answer(x);
}

static void request_ended(void *cls, struct MHD_Connection *c, void **con_cls,
                          enum MHD_RequestTerminationCode why)
{
    struct http *h = cls;
    struct exchange *x = *con_cls;
    (void)c;
    (void)why;
    if (!x)
        return;
    for (struct exchange **p = &h->exchanges; *p; p = &(*p)->next)
        if (*p == x) {
            *p = x->next;
            break;
        }
    if (x->watched_fd >= 0)
        loop_remove(h->loop, x->watched_fd);
    if (x->stream)
        h->streams--;
    stream_free(x->stream);
    free(x->reply.body);
    free(x->body);
    free(x);
    *con_cls = NULL;
}

static void connection_changed(void *cls, struct MHD_Connection *c, void **socket_context,
                               enum MHD_ConnectionNotificationCode what)
{
    struct http *h = cls;
    (void)c;
    (void)socket_context;
    h->connections += what == MHD_CONNECTION_NOTIFY_STARTED ? 1 : -1;
}

void http_answer(struct http *h, uint64_t ticket, int status, char *body)
{
    for (struct exchange *x = h->exchanges; x; x = x->next)
        if (x->ticket == ticket && x->stage == WAITING) {
            x->reply = (struct http_reply){.status = status, .body = body};
            x->stage = ANSWERED;
            MHD_resume_connection(x->connection);
            return;
        }
    free(body);
}

// --- the server ---------------------------------------------------------------------------------

static int serve(void *ctx)
{
    struct http *h = ctx;
    MHD_UNSIGNED_LONG_LONG timeout_ms;
    MHD_run(h->mhd);
    if (MHD_get_timeout(h->mhd, &timeout_ms) != MHD_YES)
        return -1;
    return timeout_ms > 60000 ? 60000 : (int)timeout_ms;
}

static void ready(void *ctx)
{
    (void)ctx; // serve() follows each round of the loop
}

void http_wake(struct http *h)
{
    for (struct exchange *x = h->exchanges; x; x = x->next)
        if (x->stream)
            stream_wake(x->stream);
}

static void ping(void *ctx)
{
    struct http *h = ctx;
    for (struct exchange *x = h->exchanges; x; x = x->next)
        if (x->stream)
            stream_ping(x->stream);
}

__attribute__((format(printf, 2, 0))) static void say(void *ctx, const char *format, va_list ap)
{
    struct http *h = ctx;
    char text[300];
    vsnprintf(text, sizeof text, format, ap);
    text[strcspn(text, "\n")] = 0;
    log_say(h->log, LOG_DEBUG, "http", "%s", text);
}

// A zero byte would end the path early, and it would name something else: left as it is, it names
// nothing.
static size_t unescape(void *cls, struct MHD_Connection *c, char *text)
{
    (void)cls;
    (void)c;
    return strstr(text, "%00") ? strlen(text) : MHD_http_unescape(text);
}

static struct MHD_Daemon *start(struct http *h, int fd)
{
    return MHD_start_daemon(
        MHD_USE_EPOLL | MHD_ALLOW_SUSPEND_RESUME | MHD_USE_ERROR_LOG, 0, NULL, NULL, access_handler,
        h, MHD_OPTION_EXTERNAL_LOGGER, say, h, // first, so that it hears of the others
        MHD_OPTION_LISTEN_SOCKET, fd, MHD_OPTION_NOTIFY_COMPLETED, request_ended, h,
        MHD_OPTION_NOTIFY_CONNECTION, connection_changed, h, MHD_OPTION_CONNECTION_LIMIT,
        (unsigned)(MOST_CONNECTIONS + SPARE_CONNECTIONS), MHD_OPTION_CONNECTION_MEMORY_LIMIT,
        (size_t)CONNECTION_MEMORY, MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)SILENCE_S,
        MHD_OPTION_STRICT_FOR_CLIENT, 1, MHD_OPTION_UNESCAPE_CALLBACK, unescape, h,
        MHD_OPTION_END);
}

struct http *http_new(struct loop *loop, int listen_fd, const struct events *events,
                      const struct http_ports *ports, struct log *log, struct gon_error *err)
{
    struct http *h = calloc(1, sizeof *h);
    int fd = fcntl(listen_fd, F_DUPFD_CLOEXEC, 3); // the library closes what it is given
    if (!h || fd < 0) {
        free(h);
        gon_fail(err, GON_E_SYSTEM, "http: %s", strerror(errno));
        return NULL;
    }
    *h = (struct http){.loop = loop, .events = events, .ports = *ports, .log = log, .epoll_fd = -1};
    if (!(h->mhd = start(h, fd))) {
        close(fd);
        free(h);
        gon_fail(err, GON_E_SYSTEM, "http: the server did not start");
        return NULL;
    }
    h->epoll_fd = MHD_get_daemon_info(h->mhd, MHD_DAEMON_INFO_EPOLL_FD)->listen_fd;
    if (loop_add(loop, h->epoll_fd, ready, h, err) < 0 ||
        loop_every(loop, PING_MS, ping, h, err) < 0) {
        http_free(h);
        return NULL;
    }
    loop_after(loop, serve, h);
    return h;
}

// What waits is answered and each stream ended, with a few rounds to send it: the library may not
// be stopped while a connection is suspended.
void http_free(struct http *h)
{
    if (!h)
        return;
    h->stopping = true;
    loop_after(h->loop, NULL, NULL);
    loop_remove(h->loop, h->epoll_fd);
    for (struct exchange *x = h->exchanges; x; x = x->next) {
        if (x->stream)
            stream_close(x->stream);
        else if (x->stage == WAITING)
            http_answer(h, x->ticket, 503,
                        http_error("the daemon is ending", NULL, "start it again"));
    }
    for (int i = 0; i < 5; i++)
        MHD_run(h->mhd);
    MHD_stop_daemon(h->mhd);
    free(h);
}
