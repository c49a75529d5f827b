// SPDX-License-Identifier: MIT
#include "base/log.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

struct log {
    FILE *out;
    enum log_level most;
    int with_time;
    int fd;           // of out, where its reader could hold up whoever writes; else -1
    int opened;       // the same opened anew, for the flag O_NONBLOCK is others' too; else -1
    bool is_socket;
    atomic_long lost; // lines
};

struct log *log_new(FILE *out, enum log_level most, int with_time)
{
    struct log *log = malloc(sizeof *log);
    struct stat st;
    char path[40];
    const int fd = fileno(out);
    if (!log)
        return NULL;
    *log = (struct log){.out = out, .most = most, .with_time = with_time, .fd = -1, .opened = -1};
    if (fd < 0 || fstat(fd, &st) < 0 || S_ISREG(st.st_mode))
        return log;
    log->fd = fd;
    log->is_socket = S_ISSOCK(st.st_mode);
    snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
    if (!log->is_socket)
        log->opened = open(path, O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    return log;
}

void log_free(struct log *log)
{
    if (log && log->opened >= 0)
        close(log->opened);
    free(log);
}

// Without waiting, a whole line or none; a pipe's writes are whole up to PIPE_BUF.
static bool put(const struct log *log, const char *line, size_t size)
{
    if (log->is_socket)
        return send(log->fd, line, size, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)size;
    if (log->opened >= 0)
        return write(log->opened, line, size) == (ssize_t)size;
    struct pollfd p = {.fd = log->fd, .events = POLLOUT};
    return poll(&p, 1, 0) == 1 && write(log->fd, line, size) == (ssize_t)size;
}

// What was lost is said before the first line that is not.
static void put_or_count(struct log *log, const char *line)
{
    char text[100];
    const long lost = atomic_exchange(&log->lost, 0);
    snprintf(text, sizeof text, "log: warning: %ld lines are lost: nobody read them\n", lost);
    if (lost && !put(log, text, strlen(text)))
        atomic_fetch_add(&log->lost, lost + 1);
    else if (!put(log, line, strlen(line)))
        atomic_fetch_add(&log->lost, 1);
}

static int put_time(char *buf, size_t size)
{
    struct timespec ts;
    struct tm tm;
    clock_gettime(CLOCK_REALTIME, &ts);
    gmtime_r(&ts.tv_sec, &tm);
    int n = (int)strftime(buf, size, "%Y-%m-%dT%H:%M:%S", &tm);
    return n + snprintf(buf + n, size - (size_t)n, ".%03ldZ ", ts.tv_nsec / 1000000);
}

void log_say(struct log *log, enum log_level level, const char *tag, const char *fmt, ...)
{
    static const char *const names[] = {"error", "warning", "notice", "info", "debug"};
    if (!log || level > log->most)
        return;

    int saved = errno;
    char line[1025];
    const size_t room = sizeof line - 1; // for the newline
    int n = log->with_time ? put_time(line, room) : 0;
    n += snprintf(line + n, room - (size_t)n, "%s: ", tag);
    if (level <= LOG_WARN)
        n += snprintf(line + n, room - (size_t)n, "%s: ", names[level]);
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(line + n, room - (size_t)n, fmt, ap);
    va_end(ap);
    strcat(line, "\n"); // written by one call, so that lines of two threads do not mix
    if (log->fd >= 0) {
        put_or_count(log, line);
    } else {
        fputs(line, log->out);
        fflush(log->out);
    }
    errno = saved;
}
