// SPDX-License-Identifier: MIT
#include "base/log.h"

#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <time.h>

struct log {
    FILE *out;
    enum log_level most;
    int with_time;
};

struct log *log_new(FILE *out, enum log_level most, int with_time)
{
    struct log *log = malloc(sizeof *log);
    if (log)
        *log = (struct log){out, most, with_time};
    return log;
}

void log_free(struct log *log)
{
    free(log);
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
    char line[1024];
    int n = log->with_time ? put_time(line, sizeof line) : 0;
    n += snprintf(line + n, sizeof line - (size_t)n, "%s: ", tag);
    if (level <= LOG_WARN)
        n += snprintf(line + n, sizeof line - (size_t)n, "%s: ", names[level]);
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(line + n, sizeof line - (size_t)n, fmt, ap);
    va_end(ap);
    fprintf(log->out, "%s\n", line); // one call, so that lines of two threads do not mix
    fflush(log->out);
    errno = saved;
}
