// SPDX-License-Identifier: MIT
#include "daemon/service.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

struct service {
    int fd;
    struct sockaddr_un address;
    socklen_t length;
    int64_t watchdog_ns;
    char status[200];
};

// A path, or a name of the abstract kind, which is written with '@' for its leading zero.
static int take_address(struct service *s, const char *text, struct gon_error *err)
{
    const size_t size = strlen(text);
    if ((*text != '/' && *text != '@') || size < 2 || size >= sizeof s->address.sun_path)
        return gon_fail(err, GON_E_SYSTEM,
                        "NOTIFY_SOCKET=%.120s: neither a path nor an abstract name of at most %zu "
                        "bytes; unset it to run without a service manager",
                        text, sizeof s->address.sun_path - 1);
    s->address.sun_family = AF_UNIX;
    memcpy(s->address.sun_path, text, size);
    if (*text == '@')
        s->address.sun_path[0] = 0;
    s->length = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + size);
    return GON_OK;
}

// WATCHDOG_USEC counts for the process that WATCHDOG_PID names, or for whoever reads it.
static int64_t watchdog_of_environment(void)
{
    const char *us = getenv("WATCHDOG_USEC"), *pid = getenv("WATCHDOG_PID");
    if (!us || (pid && strtol(pid, NULL, 10) != (long)getpid()))
        return 0;
    const long long value = strtoll(us, NULL, 10);
    return value > 0 && value < INT64_MAX / 1000 ? (int64_t)value * 1000 : 0;
}

int service_open(struct service **ret_service, struct gon_error *err)
{
    *ret_service = NULL;
    const char *text = getenv("NOTIFY_SOCKET");
    if (!text || !*text)
        return GON_OK;
    struct service *s = calloc(1, sizeof *s);
    if (!s)
        return gon_fail(err, GON_E_SYSTEM, "out of memory");
    s->fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const int error = errno;
    int rc = take_address(s, text, err);
    if (rc == 0 && s->fd < 0)
        rc = gon_fail(err, GON_E_SYSTEM, "NOTIFY_SOCKET: no socket: %s", strerror(error));
    if (rc < 0) {
        service_close(s);
        return rc;
    }
    s->watchdog_ns = watchdog_of_environment();
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    unsetenv("WATCHDOG_PID");
    *ret_service = s;
    return GON_OK;
}

void service_close(struct service *s)
{
    if (s && s->fd >= 0)
        close(s->fd);
    free(s);
}

// A manager that does not listen is no reason to measure any worse.
static void tell(struct service *s, const char *text)
{
    if (s)
        (void)sendto(s->fd, text, strlen(text), MSG_NOSIGNAL, (const struct sockaddr *)&s->address,
                     s->length);
}

void service_ready(struct service *s)
{
    tell(s, "READY=1");
}

void service_ending(struct service *s)
{
    tell(s, "STOPPING=1");
}

void service_status(struct service *s, const char *text)
{
    char line[sizeof s->status + 8];
    if (!s || !strncmp(s->status, text, sizeof s->status - 1))
        return;
    snprintf(s->status, sizeof s->status, "%s", text);
    snprintf(line, sizeof line, "STATUS=%s", s->status);
    line[strcspn(line, "\n")] = 0; // a line more would be another assignment
    tell(s, line);
}

int64_t service_watchdog_ns(const struct service *s)
{
    return s ? s->watchdog_ns : 0;
}

void service_alive(struct service *s)
{
    tell(s, "WATCHDOG=1");
}
