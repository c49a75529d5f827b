// SPDX-License-Identifier: MIT
// Lets libserialport open ptys, for tests only: preloaded (LD_PRELOAD=libptycompat.so) or linked
// into a test program. PTYCOMPAT names the ports: "gonio0=/path/to/pty:gonio1=/another/path"; they
// appear as /dev/gonio0, /dev/gonio1. A path may be a symbolic link that changes; it is followed at
// each open.
//
// What libserialport 0.1.1 asks of a real port and a pty does not have:
//   /sys/class/tty/NAME exists and leads somewhere          lstat, readlink, stat, access
//   TIOCMGET and TIOCMSET, TIOCMBIS, TIOCMBIC               kept per descriptor, DTR and RTS as set
//   PARENB                                                  kept; a pty drops it: EINVAL
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
enum { FDS = 1024, DEV = 5, CLASS = 15 }; // lengths of "/dev/" and "/sys/class/tty/"

static struct {
    bool mine;
    int lines;        // of the modem
    tcflag_t parity;  // PARENB and PARODD as they were set
} port[FDS];

// The pty of "/dev/NAME" or "/sys/class/tty/NAME"; false: not one of ours.
static bool find(const char *path, size_t skip, const char *prefix, char *ret, size_t size)
{
    const char *list = getenv("PTYCOMPAT");
    if (!path || !list || strncmp(path, prefix, skip) != 0)
        return false;
    const size_t name = strlen(path + skip);
    for (const char *at = list; name > 0 && *at; at += strcspn(at, ":"), at += *at == ':') {
        if (strncmp(at, path + skip, name) != 0 || at[name] != '=')
            continue;
        snprintf(ret, size, "%.*s", (int)strcspn(at + name + 1, ":"), at + name + 1);
        return true;
    }
    return false;
}

static bool is_device(const char *path, char *ret, size_t size)
{
    return find(path, DEV, "/dev/", ret, size);
}

static bool is_class(const char *path)
{
    char pty[256];
    return find(path, CLASS, "/sys/class/tty/", pty, sizeof pty);
}

// --- files ---------------------------------------------------------------------------------------

static int open_any(const char *path, int flags, mode_t mode)
{
    char pty[256];
    const bool mine = is_device(path, pty, sizeof pty);
    int fd = REAL(open)(mine ? pty : path, flags, mode);
    if (fd >= 0 && fd < FDS) {
        port[fd].mine = mine;
        port[fd].lines = TIOCM_CTS | TIOCM_DSR | TIOCM_CAR | TIOCM_DTR | TIOCM_RTS;
        port[fd].parity = 0;
    }
    return fd;
}

int open(const char *path, int flags, ...)
{
    va_list ap;
    va_start(ap, flags);
    mode_t mode = flags & (O_CREAT | __O_TMPFILE) ? va_arg(ap, mode_t) : 0;
    va_end(ap);
    return open_any(path, flags, mode);
}

int __open_2(const char *path, int flags);
int __open_2(const char *path, int flags)
{
    return open_any(path, flags, 0);
}

int stat(const char *restrict path, struct stat *restrict s)
{
    char pty[256];
    if (is_class(path))
        return REAL(stat)("/sys/class/tty", s);
    return REAL(stat)(is_device(path, pty, sizeof pty) ? pty : path, s);
}

int lstat(const char *restrict path, struct stat *restrict s)
{
    char pty[256];
    if (!is_class(path))
        return is_device(path, pty, sizeof pty) ? stat(path, s) : REAL(lstat)(path, s);
    int rc = REAL(stat)("/sys/class/tty", s);
    s->st_mode = S_IFLNK | 0777;
    return rc;
}

int __lxstat(int version, const char *path, struct stat *s);
int __lxstat(int version, const char *path, struct stat *s)
{
    (void)version;
    return lstat(path, s);
}

ssize_t readlink(const char *restrict path, char *restrict to, size_t size)
{
    static const char target[] = "../../devices/virtual/tty/pty";
    char pty[256];
    if (is_class(path)) {
        const size_t n = sizeof target - 1 < size ? sizeof target - 1 : size;
        memcpy(to, target, n);
        return (ssize_t)n;
    }
    if (is_device(path, pty, sizeof pty)) {
        errno = EINVAL; // a node, not a link
        return -1;
    }
    return REAL(readlink)(path, to, size);
}

int close(int fd)
{
    if (fd >= 0 && fd < FDS)
        port[fd].mine = false;
    return REAL(close)(fd);
}

// --- terminals -----------------------------------------------------------------------------------

static bool is_mine(int fd)
{
    return fd >= 0 && fd < FDS && port[fd].mine;
}

int ioctl(int fd, unsigned long request, ...)
{
    va_list ap;
    va_start(ap, request);
    void *argument = va_arg(ap, void *);
    va_end(ap);
    if (is_mine(fd))
        switch (request) {
        case TIOCMGET: *(int *)argument = port[fd].lines; return 0;
        case TIOCMSET: port[fd].lines = *(int *)argument; return 0;
        case TIOCMBIS: port[fd].lines |= *(int *)argument; return 0;
        case TIOCMBIC: port[fd].lines &= ~*(int *)argument; return 0;
        default: break;
        }
    return REAL(ioctl)(fd, request, argument);
}

int tcgetattr(int fd, struct termios *t)
{
    int rc = REAL(tcgetattr)(fd, t);
    if (rc == 0 && is_mine(fd))
        t->c_cflag = (t->c_cflag & ~(tcflag_t)(PARENB | PARODD)) | port[fd].parity;
    return rc;
}

int tcsetattr(int fd, int when, const struct termios *t)
{
    if (!is_mine(fd))
        return REAL(tcsetattr)(fd, when, t);
    struct termios plain = *t;
    port[fd].parity = t->c_cflag & (PARENB | PARODD);
    plain.c_cflag &= ~(tcflag_t)(PARENB | PARODD);
    return REAL(tcsetattr)(fd, when, &plain);
}
