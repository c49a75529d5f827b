// SPDX-License-Identifier: MIT
#include "drivers/transport_port.h"

#include "drivers/transport_adapter.h"
#include "drivers/transport_claim.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <libserialport.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

#define LINKS_MOST 8
#define PTY_FIRST 136 // majors of pty slaves (Documentation/admin-guide/devices.txt)
#define PTY_LAST 143

struct serial_port {
    struct sp_port *library; // NULL: termios alone
    int fd;
};

// --- names ---------------------------------------------------------------------------------------

// Drops "." and "x/.." textually; path is absolute.
static void tidy(char *path)
{
    char draft[PATH_MAX] = "";
    size_t used = 0;
    char *save = NULL;
    for (char *part = strtok_r(path, "/", &save); part; part = strtok_r(NULL, "/", &save)) {
        if (strcmp(part, ".") == 0)
            continue;
        if (strcmp(part, "..") == 0) {
            while (used > 0 && draft[--used] != '/')
                ;
            draft[used] = 0;
        } else {
            used += (size_t)snprintf(draft + used, sizeof draft - used, "/%s", part);
        }
    }
    strcpy(path, used ? draft : "/");
}

// Follows symbolic links by their text: realpath() fails where a device node is only pretended.
static void resolve(const char *path, char ret_name[PATH_MAX])
{
    char target[PATH_MAX], folder[PATH_MAX];
    snprintf(ret_name, PATH_MAX, "%s", path);
    for (int i = 0; i < LINKS_MOST; i++) {
        ssize_t n = readlink(ret_name, target, sizeof target - 1);
        if (n <= 0)
            return;
        target[n] = 0;
        snprintf(folder, sizeof folder, "%s", ret_name);
        const char *before = target[0] == '/' ? "" : dirname(folder);
        if (strlen(before) + (size_t)n + 2 > PATH_MAX)
            return;
        char joined[2 * PATH_MAX];
        snprintf(joined, sizeof joined, "%s/%s", before, target);
        memcpy(ret_name, joined, strlen(joined) + 1);
        if (ret_name[0] == '/')
            tidy(ret_name);
    }
}

static bool is_pty(int fd)
{
    struct stat s;
    return fstat(fd, &s) == 0 && major(s.st_rdev) >= PTY_FIRST && major(s.st_rdev) <= PTY_LAST;
}

// --- by libserialport ----------------------------------------------------------------------------

// 0; or an errno. ENOTTY: the library refuses what may still be a terminal.
static int library_open(const char *name, struct serial_port *p)
{
    struct sp_port *port;
    if (sp_get_port_by_name(name, &port) != SP_OK)
        return ENOTTY;
    if (sp_open(port, SP_MODE_READ_WRITE) != SP_OK) {
        int error = errno;
        sp_free_port(port);
        return error ? error : EIO;
    }
    p->library = port;
    sp_get_port_handle(port, &p->fd); // 0.1.1 opens it non-blocking, but leaves it to children
    fcntl(p->fd, F_SETFD, FD_CLOEXEC);
    return 0;
}

static enum sp_parity library_parity(char parity)
{
    return parity == 'E' ? SP_PARITY_EVEN : parity == 'O' ? SP_PARITY_ODD : SP_PARITY_NONE;
}

static int library_configure(struct sp_port *port, const struct link *l)
{
    struct sp_port_config *c;
    if (sp_new_config(&c) != SP_OK)
        return ENOMEM;
    sp_set_config_baudrate(c, l->baud);
    sp_set_config_bits(c, 8);
    sp_set_config_parity(c, library_parity(l->parity));
    sp_set_config_stopbits(c, l->stop);
    sp_set_config_flowcontrol(c, SP_FLOWCONTROL_NONE);
    int error = sp_set_config(port, c) == SP_OK ? 0 : errno ? errno : EIO;
    sp_free_config(c);
    return error;
}

// --- by termios ----------------------------------------------------------------------------------

static int plain_open(const char *name, struct serial_port *p)
{
    p->fd = open(name, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (p->fd < 0)
        return errno;
    return isatty(p->fd) ? 0 : ENOTTY;
}

static speed_t speed_of(int baud)
{
    static const struct {
        int baud;
        speed_t speed;
    } speeds[] = {{1200, B1200},     {2400, B2400},     {4800, B4800},     {9600, B9600},
                  {19200, B19200},   {38400, B38400},   {57600, B57600},   {115200, B115200},
                  {230400, B230400}, {460800, B460800}, {921600, B921600}};
    for (size_t i = 0; i < sizeof speeds / sizeof speeds[0]; i++)
        if (speeds[i].baud == baud)
            return speeds[i].speed;
    return B0;
}

// Ptys drop PARENB, and tcsetattr then reports EINVAL: no parity is asked of them.
static int plain_configure(int fd, const struct link *l)
{
    struct termios t;
    if (tcgetattr(fd, &t))
        return errno;
    cfmakeraw(&t);
    t.c_cflag &= ~(tcflag_t)(CSTOPB | CRTSCTS | PARENB | PARODD);
    t.c_cflag |= CREAD | CLOCAL;
    if (l->stop == 2)
        t.c_cflag |= CSTOPB;
    if (l->parity != 'N' && !is_pty(fd))
        t.c_cflag |= PARENB | (l->parity == 'O' ? PARODD : 0);
    cfsetspeed(&t, speed_of(l->baud));
    return tcsetattr(fd, TCSANOW, &t) ? errno : 0;
}

// --- both ----------------------------------------------------------------------------------------

static int configure(const struct serial_port *p, const struct link *l)
{
    if (!p->library)
        return plain_configure(p->fd, l);
    int error = library_configure(p->library, l);
    if (error != EINVAL || !is_pty(p->fd))
        return error;
    struct link plain = *l;
    plain.parity = 'N';
    return library_configure(p->library, &plain);
}

static int open_port(const struct link *link, struct serial_port *p, struct gon_error *err)
{
    char name[PATH_MAX];
    int rc = 0;
    if (link->adapter)
        rc = transport_adapter_find(link, name, sizeof name, err);
    else
        resolve(link->place, name);
    if (rc < 0)
        return rc;
    errno = 0;
    int error = library_open(name, p);
    if (error == ENOTTY)
        error = plain_open(name, p);
    if (error)
        return transport_claim_failed(link->place, name, error, err);
    rc = transport_claim(p->fd, link->place, err);
    if (rc < 0)
        return rc;
    error = configure(p, link);
    if (error)
        return gon_fail(err, GON_E_GONE,
                        "%s: cannot be set to %d baud, parity %c, %d stop bits: %s", link->place,
                        link->baud, link->parity, link->stop, strerror(error));
    tcflush(p->fd, TCIOFLUSH);
    return 0;
}

int transport_serial_open(const struct link *link, struct serial_port **ret_port,
                          struct gon_error *err)
{
    struct serial_port *p = malloc(sizeof *p);
    if (!p)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link->place);
    *p = (struct serial_port){.fd = -1};
    int rc = open_port(link, p, err);
    if (rc < 0) {
        transport_serial_close(p);
        return rc;
    }
    *ret_port = p;
    return 0;
}

void transport_serial_close(struct serial_port *p)
{
    if (!p)
        return;
    if (p->library) {
        sp_close(p->library);
        sp_free_port(p->library);
    } else if (p->fd >= 0) {
        close(p->fd);
    }
    free(p);
}

int transport_serial_fd(const struct serial_port *p)
{
    return p->fd;
}

bool transport_serial_by_library(const struct serial_port *p)
{
    return p->library != NULL;
}
