// SPDX-License-Identifier: MIT
// libc's calls over the virtual operating system. Defined in the program they take precedence over
// those of the shared library, also for libmodbus and SQLite. Descriptors of lines and event
// counters are virtual, from a range of their own below FD_SETSIZE (libmodbus uses select);
// everything else goes to the real call. While no simulation runs everything is real.
#include "tests/dst/libc.h"

#include "tests/dst/disk.h"

#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/time.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

enum { FIRST = 900, COUNT = 100 };
enum { USB_SERIAL = 188 }; // major of ttyUSB

enum kind { KIND_FREE, KIND_LINE, KIND_SOCKET, KIND_EVENTS };

static struct descriptor {
    enum kind kind;
    struct line *line; // KIND_SOCKET: NULL until it is connected
    uint64_t events;
    bool connecting; // to something that does not answer
} descriptors[COUNT];

static struct line *lines[LIBC_LINES];
static int lines_count;

void libc_add_line(struct line *l)
{
    if (lines_count == LIBC_LINES)
        abort();
    lines[lines_count++] = l;
}

void libc_forget(void)
{
    memset(descriptors, 0, sizeof descriptors);
    lines_count = 0;
}

static struct descriptor *virtual(int fd)
{
    return fd >= FIRST && fd < FIRST + COUNT && descriptors[fd - FIRST].kind
               ? &descriptors[fd - FIRST]
               : NULL;
}

static int make(enum kind kind)
{
    for (int i = 0; i < COUNT; i++)
        if (!descriptors[i].kind) {
            descriptors[i] = (struct descriptor){.kind = kind};
            return FIRST + i;
        }
    errno = EMFILE;
    return -1;
}

static int fail(int error)
{
    errno = error;
    return -1;
}

// --- opening and closing -------------------------------------------------------------------------

static int open_line(const char *path)
{
    for (int i = 0; i < lines_count; i++)
        if (lines[i]->path && strcmp(lines[i]->path, path) == 0) {
            const int fd = make(KIND_LINE);
            if (fd >= 0 && !line_open(lines[i], fd)) {
                descriptors[fd - FIRST].kind = KIND_FREE;
                return -1;
            }
            if (fd >= 0)
                descriptors[fd - FIRST].line = lines[i];
            return fd;
        }
    return fail(ENOENT);
}

static bool is_ours(const char *path)
{
    return os.on && strncmp(path, LIBC_DEVICES, strlen(LIBC_DEVICES)) == 0;
}

#define MODE_OF(flags)                                                                             \
    mode_t mode = 0;                                                                               \
    if ((flags) & (O_CREAT | O_TMPFILE)) {                                                         \
        va_list ap;                                                                                \
        va_start(ap, flags);                                                                       \
        mode = (mode_t)va_arg(ap, int);                                                            \
        va_end(ap);                                                                                \
    }

int open(const char *path, int flags, ...)
{
    MODE_OF(flags)
    return is_ours(path) ? open_line(path) : REAL(open)(path, flags, mode);
}

int open64(const char *path, int flags, ...)
{
    MODE_OF(flags)
    if (is_ours(path))
        return open_line(path);
    const int fd = REAL(open64)(path, flags, mode);
    disk_opened(fd, path);
    return fd;
}

int openat(int folder, const char *path, int flags, ...)
{
    MODE_OF(flags)
    return is_ours(path) ? open_line(path) : REAL(openat)(folder, path, flags, mode);
}

int close(int fd)
{
    struct descriptor *d = virtual(fd);
    disk_closed(fd);
    if (!d)
        return REAL(close)(fd);
    if (d->line)
        line_close(d->line);
    d->kind = KIND_FREE;
    return 0;
}

int eventfd(unsigned initial, int flags)
{
    if (!os.on)
        return REAL(eventfd)(initial, flags);
    const int fd = make(KIND_EVENTS);
    if (fd >= 0)
        descriptors[fd - FIRST].events = initial;
    return fd;
}

int socket(int domain, int type, int protocol)
{
    return os.on && domain == AF_INET ? make(KIND_SOCKET) : REAL(socket)(domain, type, protocol);
}

int connect(int fd, const struct sockaddr *address, socklen_t size)
{
    struct descriptor *d = virtual(fd);
    if (!d)
        return REAL(connect)(fd, address, size);
    const uint32_t host = ntohl(((const struct sockaddr_in *)address)->sin_addr.s_addr);
    for (int i = 0; i < lines_count; i++)
        if (!lines[i]->path && lines[i]->address == host) {
            if (lines[i]->hole) {
                d->connecting = true;
                return fail(EINPROGRESS);
            }
            if (!line_open(lines[i], fd))
                return -1;
            d->line = lines[i];
            return 0;
        }
    return fail(ENETUNREACH);
}

int setsockopt(int fd, int level, int option, const void *value, socklen_t size)
{
    return virtual(fd) ? 0 : REAL(setsockopt)(fd, level, option, value, size);
}

int getsockopt(int fd, int level, int option, void *value, socklen_t *size)
{
    if (!virtual(fd))
        return REAL(getsockopt)(fd, level, option, value, size);
    memset(value, 0, *size);
    return 0;
}

int shutdown(int fd, int how)
{
    return virtual(fd) ? 0 : REAL(shutdown)(fd, how);
}

// --- bytes ---------------------------------------------------------------------------------------

static ssize_t read_events(struct descriptor *d, void *to)
{
    if (!d->events)
        return fail(EAGAIN);
    memcpy(to, &d->events, sizeof d->events);
    d->events = 0;
    return sizeof d->events;
}

ssize_t read(int fd, void *to, size_t size)
{
    struct descriptor *d = virtual(fd);
    if (!d)
        return REAL(read)(fd, to, size);
    if (d->kind == KIND_EVENTS)
        return read_events(d, to);
    return d->line ? line_read(d->line, to, size) : fail(ENOTCONN);
}

ssize_t write(int fd, const void *from, size_t size)
{
    struct descriptor *d = virtual(fd);
    if (!d)
        return REAL(write)(fd, from, size);
    if (d->kind == KIND_EVENTS) {
        uint64_t more;
        memcpy(&more, from, sizeof more);
        d->events += more;
        return sizeof more;
    }
    return d->line ? line_write(d->line, from, size) : fail(ENOTCONN);
}

ssize_t recv(int fd, void *to, size_t size, int flags)
{
    return virtual(fd) ? read(fd, to, size) : REAL(recv)(fd, to, size, flags);
}

ssize_t send(int fd, const void *from, size_t size, int flags)
{
    return virtual(fd) ? write(fd, from, size) : REAL(send)(fd, from, size, flags);
}

// --- waiting -------------------------------------------------------------------------------------

struct polled {
    struct pollfd *fds;
    nfds_t n;
};

static short revents_of(const struct descriptor *d, short events)
{
    if (!d)
        return POLLNVAL;
    if (d->kind == KIND_EVENTS)
        return (short)(events & (POLLOUT | (d->events ? POLLIN : 0)));
    return d->line ? line_revents(d->line, events) : 0;
}

static bool polled_ready(void *ctx)
{
    struct polled *p = ctx;
    bool ready = false;
    for (nfds_t i = 0; i < p->n; i++) {
        p->fds[i].revents =
            p->fds[i].fd < 0 ? 0 : revents_of(virtual(p->fds[i].fd), p->fds[i].events);
        ready = ready || p->fds[i].revents;
    }
    return ready;
}

static int64_t polled_next_ns(void *ctx)
{
    const struct polled *p = ctx;
    int64_t next_ns = OS_NEVER;
    for (nfds_t i = 0; i < p->n; i++) {
        const struct descriptor *d = virtual(p->fds[i].fd);
        const int64_t t_ns = d && d->line ? line_next_ns(d->line) : OS_NEVER;
        next_ns = t_ns < next_ns ? t_ns : next_ns;
    }
    return next_ns;
}

static bool all_virtual(const struct pollfd *fds, nfds_t n)
{
    for (nfds_t i = 0; i < n; i++)
        if (fds[i].fd >= 0 && !virtual(fds[i].fd))
            return false;
    return os.on;
}

static int poll_until(struct pollfd *fds, nfds_t n, int64_t until_ns)
{
    int ready = 0;
    struct polled p = {fds, n};
    os_wait(until_ns, polled_ready, polled_next_ns, &p);
    for (nfds_t i = 0; i < n; i++)
        ready += fds[i].revents != 0;
    return ready;
}

// By their assembler names: libc declares that poll only writes its array, which is not so.
int libc_ppoll(struct pollfd *fds, nfds_t n, const struct timespec *timeout,
               const sigset_t *mask) __asm__("ppoll");
int libc_poll(struct pollfd *fds, nfds_t n, int timeout_ms) __asm__("poll");

static int64_t ns_of(const struct timespec *t)
{
    return (int64_t)t->tv_sec * 1000000000 + t->tv_nsec;
}

int libc_ppoll(struct pollfd *fds, nfds_t n, const struct timespec *timeout, const sigset_t *mask)
{
    if (!all_virtual(fds, n))
        return REAL(ppoll)(fds, n, timeout, mask);
    return poll_until(fds, n, timeout ? os.now_ns + ns_of(timeout) : OS_NEVER);
}

int libc_poll(struct pollfd *fds, nfds_t n, int timeout_ms)
{
    if (!all_virtual(fds, n))
        return REAL(poll)(fds, n, timeout_ms);
    return poll_until(fds, n, timeout_ms < 0 ? OS_NEVER : os.now_ns + timeout_ms * 1000000LL);
}

int select(int n, fd_set *in, fd_set *out, fd_set *error, struct timeval *timeout)
{
    struct descriptor *d = n > 0 ? virtual(n - 1) : NULL;
    if (!d || !d->line || !in || !FD_ISSET(n - 1, in))
        return REAL(select)(n, in, out, error, timeout);
    const int64_t ns = (int64_t)timeout->tv_sec * 1000000000 + timeout->tv_usec * 1000LL;
    if (os_wait(os.now_ns + ns, line_readable, line_next_ns, d->line))
        return 1;
    FD_ZERO(in);
    return 0;
}

// --- terminals and locks -------------------------------------------------------------------------

int tcflush(int fd, int which)
{
    struct descriptor *d = virtual(fd);
    if (!d)
        return REAL(tcflush)(fd, which);
    line_flush(d->line);
    return 0;
}

int tcgetattr(int fd, struct termios *ret)
{
    if (!virtual(fd))
        return REAL(tcgetattr)(fd, ret);
    memset(ret, 0, sizeof *ret);
    return 0;
}

int tcsetattr(int fd, int when, const struct termios *t)
{
    return virtual(fd) ? 0 : REAL(tcsetattr)(fd, when, t);
}

int tcdrain(int fd)
{
    return virtual(fd) ? 0 : REAL(tcdrain)(fd);
}

int isatty(int fd)
{
    struct descriptor *d = virtual(fd);
    return d ? d->line && d->line->path : REAL(isatty)(fd);
}

int ioctl(int fd, unsigned long request, ...)
{
    va_list ap;
    va_start(ap, request);
    void *argument = va_arg(ap, void *);
    va_end(ap);
    return virtual(fd) ? 0 : REAL(ioctl)(fd, request, argument);
}

int flock(int fd, int operation)
{
    return virtual(fd) ? 0 : REAL(flock)(fd, operation);
}

int fstat(int fd, struct stat *ret)
{
    if (!virtual(fd))
        return REAL(fstat)(fd, ret);
    *ret = (struct stat){.st_mode = S_IFCHR | 0660, .st_rdev = makedev(USB_SERIAL, (unsigned)fd)};
    return 0;
}

int fcntl(int fd, int command, ...)
{
    va_list ap;
    va_start(ap, command);
    void *argument = va_arg(ap, void *);
    va_end(ap);
    return virtual(fd) ? 0 : REAL(fcntl)(fd, command, argument);
}

// --- files: SQLite's -----------------------------------------------------------------------------

int fcntl64(int fd, int command, ...)
{
    va_list ap;
    va_start(ap, command);
    void *argument = va_arg(ap, void *);
    va_end(ap);
    if (command == F_SETLK && disk_locked(fd, argument))
        return fail(EAGAIN);
    return virtual(fd) ? 0 : REAL(fcntl64)(fd, command, argument);
}

ssize_t pwrite64(int fd, const void *from, size_t size, off64_t at)
{
    const int error = disk_write(fd, size);
    return error ? fail(error) : REAL(pwrite64)(fd, from, size, at);
}

ssize_t pread64(int fd, void *to, size_t size, off64_t at)
{
    const int error = disk_read(fd);
    return error ? fail(error) : REAL(pread64)(fd, to, size, at);
}

int ftruncate64(int fd, off64_t size)
{
    const int error = disk_write(fd, 0);
    return error ? fail(error) : REAL(ftruncate64)(fd, size);
}

int fdatasync(int fd)
{
    bool real = true;
    const int error = disk_sync(fd, &real);
    return error ? fail(error) : real ? REAL(fdatasync)(fd) : 0;
}

int fsync(int fd)
{
    return os.on ? 0 : REAL(fsync)(fd);
}
