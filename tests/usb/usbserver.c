// SPDX-License-Identifier: MIT
#include "tests/usb/usbserver.h"

#include "base/clk.h"

#include <errno.h>
#include <fcntl.h>
#include <glib.h>
#include <linux/usbdevice_fs.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <umockdev.h>
#include <unistd.h>

enum { URBS = 16 };

struct urb {
    UMockdevIoctlData *data; // struct usbdevfs_urb in the client, with its buffer below
    bool done;
};

struct device {
    struct usbserver *server;
    struct sim_usbtmc model;
    bool plugged;
    int master, slave; // of the pty behind the node
    char node[64], sysfs[64];
    UMockdevIoctlBase *handler;    // of the node that is plugged in; the old ones say ENODEV
    UMockdevIoctlClient *claimant; // who has the interface
    struct urb urbs[URBS];
    int count;
};

struct usbserver {
    UMockdevTestbed *testbed;
    char *dir;
    GMutex lock;
    int wake; // eventfd
    int devices;
    struct device device[USBSERVER_DEVICES];
};

static void die(const char *what)
{
    fprintf(stderr, "usbserver: %s: %s\n", what, strerror(errno));
    exit(1);
}

// --- requests of the client's kernel -------------------------------------------------------------

static struct usbdevfs_urb *urb_of(const struct urb *u)
{
    return (struct usbdevfs_urb *)u->data->data;
}

static int status_of(int n)
{
    return n == SIM_USB_STALL ? -EPIPE : 0;
}

// Carries one out if it can be: then it is done.
static void attempt(struct device *d, struct urb *u, int64_t t_ns)
{
    struct usbdevfs_urb *urb = urb_of(u);
    uint8_t *bytes = urb->buffer;
    const size_t size = (size_t)urb->buffer_length;
    int n;
    if (urb->type == USBDEVFS_URB_TYPE_CONTROL)
        n = sim_usbtmc_control(&d->model, bytes, bytes + SIM_USB_SETUP, size - SIM_USB_SETUP, t_ns);
    else if (urb->endpoint == SIM_USB_OUT)
        n = sim_usbtmc_bulk_out(&d->model, bytes, size, t_ns);
    else
        n = sim_usbtmc_bulk_in(&d->model, bytes, size, t_ns);
    if (n == SIM_USB_NAK)
        return;
    urb->status = status_of(n);
    urb->actual_length = n > 0 ? n : 0;
    u->done = true;
}

// The node can be written to when a request waits to be reaped.
static void show_ready(struct device *d)
{
    bool ready = false;
    for (int i = 0; i < d->count; i++)
        ready |= d->urbs[i].done;
    tcflow(d->slave, ready ? TCOON : TCOOFF);
}

static void pump(struct device *d)
{
    if (!d->plugged)
        return;
    for (int i = 0; i < d->count; i++)
        if (!d->urbs[i].done)
            attempt(d, &d->urbs[i], clk_now_ns(clk_system()));
    show_ready(d);
}

static void drop_urb(struct device *d, int i)
{
    umockdev_ioctl_data_unref(d->urbs[i].data);
    d->count--;
    memmove(&d->urbs[i], &d->urbs[i + 1], (size_t)(d->count - i) * sizeof d->urbs[0]);
}

static int submit(struct device *d, UMockdevIoctlData *arg)
{
    if (d->count == URBS)
        return ENOMEM;
    UMockdevIoctlData *data =
        umockdev_ioctl_data_resolve(arg, 0, sizeof(struct usbdevfs_urb), NULL);
    if (!data)
        return EFAULT;
    const struct usbdevfs_urb *urb = (struct usbdevfs_urb *)data->data;
    UMockdevIoctlData *buffer = umockdev_ioctl_data_resolve(
        data, G_STRUCT_OFFSET(struct usbdevfs_urb, buffer), (gsize)urb->buffer_length, NULL);
    if (!buffer) {
        umockdev_ioctl_data_unref(data);
        return EFAULT;
    }
    umockdev_ioctl_data_unref(buffer); // the urb has it
    d->urbs[d->count++] = (struct urb){.data = data};
    return 0;
}

static int reap(struct device *d, UMockdevIoctlData *arg)
{
    for (int i = 0; i < d->count; i++) {
        if (!d->urbs[i].done)
            continue;
        UMockdevIoctlData *to = umockdev_ioctl_data_resolve(arg, 0, sizeof(void *), NULL);
        umockdev_ioctl_data_set_ptr(to, 0, d->urbs[i].data);
        umockdev_ioctl_data_unref(to);
        drop_urb(d, i);
        return 0;
    }
    return EAGAIN;
}

static int discard(struct device *d, UMockdevIoctlData *arg)
{
    const gulong address = *(const gulong *)arg->data;
    for (int i = 0; i < d->count; i++)
        if (d->urbs[i].data->client_addr == address && !d->urbs[i].done) {
            urb_of(&d->urbs[i])->status = -ENOENT;
            urb_of(&d->urbs[i])->actual_length = 0;
            d->urbs[i].done = true;
            return 0;
        }
    return EINVAL;
}

static int claim(struct device *d, UMockdevIoctlClient *client)
{
    if (d->claimant && d->claimant != client)
        return EBUSY;
    d->claimant = client;
    return 0;
}

static int clear_halt(struct device *d, UMockdevIoctlData *arg)
{
    UMockdevIoctlData *endpoint = umockdev_ioctl_data_resolve(arg, 0, sizeof(unsigned), NULL);
    const uint8_t setup[SIM_USB_SETUP] = {0x02, 1, 0, 0, endpoint->data[0]};
    uint8_t none[1];
    umockdev_ioctl_data_unref(endpoint);
    const int rc = sim_usbtmc_control(&d->model, setup, none, 0, clk_now_ns(clk_system()));
    return rc < 0 ? EPIPE : 0;
}

static int say_capabilities(UMockdevIoctlData *arg)
{
    UMockdevIoctlData *to = umockdev_ioctl_data_resolve(arg, 0, sizeof(guint32), NULL);
    *(guint32 *)to->data = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_SCATTER_GATHER |
                           USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
    umockdev_ioctl_data_unref(to);
    return 0;
}

// An errno; -1: not a request of usbfs.
static int answer(struct device *d, UMockdevIoctlClient *client, gulong request,
                  UMockdevIoctlData *arg)
{
    switch (request) {
    case USBDEVFS_GET_CAPABILITIES: return say_capabilities(arg);
    case USBDEVFS_CLAIMINTERFACE:
    case USBDEVFS_DISCONNECT_CLAIM: return claim(d, client);
    case USBDEVFS_RELEASEINTERFACE: d->claimant = NULL; return 0;
    case USBDEVFS_SUBMITURB: return submit(d, arg);
    case USBDEVFS_REAPURB:
    case USBDEVFS_REAPURBNDELAY: return reap(d, arg);
    case USBDEVFS_DISCARDURB: return discard(d, arg);
    case USBDEVFS_CLEAR_HALT: return clear_halt(d, arg);
    case USBDEVFS_RESET: sim_usbtmc_reset(&d->model); return 0;
    case USBDEVFS_SETCONFIGURATION:
    case USBDEVFS_SETINTERFACE: return 0;
    case USBDEVFS_GETDRIVER:
    case USBDEVFS_IOCTL: return ENODATA; // no kernel driver to detach or attach
    default: return -1;
    }
}

static gboolean on_ioctl(UMockdevIoctlBase *handler, UMockdevIoctlClient *client, gpointer ctx)
{
    struct device *d = ctx;
    const uint64_t one = 1;
    g_mutex_lock(&d->server->lock);
    UMockdevIoctlData *arg = umockdev_ioctl_client_get_arg(client);
    int error = ENODEV;
    if (d->plugged && handler == d->handler) {
        error = answer(d, client, umockdev_ioctl_client_get_request(client), arg);
        pump(d);
    }
    if (error >= 0)
        umockdev_ioctl_client_complete(client, error ? -1 : 0, error);
    g_mutex_unlock(&d->server->lock);
    if (write(d->server->wake, &one, sizeof one) < 0)
        die("eventfd");
    return error >= 0;
}

static void on_vanished(UMockdevIoctlBase *handler, UMockdevIoctlClient *client, gpointer ctx)
{
    struct device *d = ctx;
    g_mutex_lock(&d->server->lock);
    if (handler == d->handler && d->claimant == client) {
        d->claimant = NULL;
        while (d->count > 0)
            drop_urb(d, 0);
    }
    g_mutex_unlock(&d->server->lock);
}

// --- nodes ---------------------------------------------------------------------------------------

static void open_pty(struct device *d, char *ret_name, size_t size)
{
    struct termios t;
    d->master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (d->master < 0 || grantpt(d->master) || unlockpt(d->master) ||
        ptsname_r(d->master, ret_name, size))
        die("pty");
    d->slave = open(ret_name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (d->slave < 0 || tcgetattr(d->slave, &t))
        die(ret_name);
    cfmakeraw(&t);
    tcsetattr(d->slave, TCSANOW, &t);
    tcflow(d->slave, TCOOFF);
}

static void make_node(struct device *d, const char *pty)
{
    char path[512];
    snprintf(path, sizeof path, "%s%s", d->server->dir, d->node);
    char *folder = g_path_get_dirname(path);
    if (g_mkdir_with_parents(folder, 0755) || symlink(pty, path))
        die(path);
    g_free(folder);
}

static char *describe(const struct device *d, int bus, int address)
{
    uint8_t bytes[SIM_USB_DESCRIPTORS];
    char hex[2 * sizeof bytes + 1];
    sim_usbtmc_descriptors(&d->model, bytes);
    for (size_t i = 0; i < sizeof bytes; i++)
        snprintf(hex + 2 * i, 3, "%02x", bytes[i]);
    return g_strdup_printf("P: %s\nE: SUBSYSTEM=usb\nE: DRIVER=usb\nE: DEVTYPE=usb_device\n"
                           "E: DEVNAME=%s\nE: BUSNUM=%03d\nE: DEVNUM=%03d\n"
                           "A: busnum=%d\\n\nA: devnum=%d\\n\nA: speed=480\\n\n"
                           "A: bConfigurationValue=1\\n\nA: idVendor=%04x\\n\n"
                           "A: idProduct=%04x\\n\nH: descriptors=%s\n",
                           d->sysfs, d->node, bus, address, bus, address, d->model.identity.vendor,
                           d->model.identity.product, hex);
}

void usbserver_plug(struct usbserver *s, int device, int bus, int address)
{
    struct device *d = &s->device[device];
    GError *error = NULL;
    char pty[64];
    if (d->plugged)
        return;
    snprintf(d->node, sizeof d->node, "/dev/bus/usb/%03d/%03d", bus, address);
    snprintf(d->sysfs, sizeof d->sysfs, "/devices/usb%d", bus);
    open_pty(d, pty, sizeof pty);
    make_node(d, pty);
    g_mutex_lock(&s->lock);
    d->handler = umockdev_ioctl_base_new();
    d->plugged = true;
    g_mutex_unlock(&s->lock);
    g_signal_connect(d->handler, "handle-ioctl", G_CALLBACK(on_ioctl), d);
    g_signal_connect(d->handler, "client-vanished", G_CALLBACK(on_vanished), d);
    if (!umockdev_testbed_attach_ioctl(s->testbed, d->node, d->handler, &error))
        die(error->message);
    char *text = describe(d, bus, address);
    if (!umockdev_testbed_add_from_string(s->testbed, text, &error))
        die(error->message);
    g_free(text);
}

void usbserver_unplug(struct usbserver *s, int device)
{
    struct device *d = &s->device[device];
    char path[512];
    if (!d->plugged)
        return;
    g_mutex_lock(&s->lock);
    d->plugged = false;
    d->claimant = NULL;
    sim_usbtmc_reset(&d->model);
    while (d->count > 0)
        drop_urb(d, 0);
    g_mutex_unlock(&s->lock);
    snprintf(path, sizeof path, "%s%s", s->dir, d->node);
    unlink(path);
    close(d->slave);
    close(d->master); // whoever has the node open sees it hang up
    snprintf(path, sizeof path, "/sys%s", d->sysfs);
    umockdev_testbed_uevent(s->testbed, path, "remove");
    umockdev_testbed_remove_device(s->testbed, path);
}

// --- all of them ---------------------------------------------------------------------------------

struct usbserver *usbserver_new(void)
{
    struct usbserver *s = calloc(1, sizeof *s);
    if (!s)
        die("memory");
    g_mutex_init(&s->lock);
    s->testbed = umockdev_testbed_new();
    s->dir = umockdev_testbed_get_root_dir(s->testbed);
    s->wake = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    if (s->wake < 0)
        die("eventfd");
    return s;
}

void usbserver_free(struct usbserver *s)
{
    for (int i = 0; i < s->devices; i++)
        usbserver_unplug(s, i);
    g_object_unref(s->testbed);
    close(s->wake);
    g_free(s->dir);
    free(s);
}

const char *usbserver_dir(const struct usbserver *s)
{
    return s->dir;
}

UMockdevTestbed *usbserver_testbed(const struct usbserver *s)
{
    return s->testbed;
}

int usbserver_add(struct usbserver *s, struct port *port, const char *end,
                  const struct sim_usb_identity *identity)
{
    g_assert(s->devices < USBSERVER_DEVICES);
    struct device *d = &s->device[s->devices];
    d->server = s;
    sim_usbtmc_init(&d->model, port, end, identity);
    return s->devices++;
}

void usbserver_lock(struct usbserver *s)
{
    g_mutex_lock(&s->lock);
}

void usbserver_unlock(struct usbserver *s)
{
    g_mutex_unlock(&s->lock);
}

struct sim_usbtmc *usbserver_model(struct usbserver *s, int device)
{
    return &s->device[device].model;
}

int usbserver_fd(const struct usbserver *s)
{
    return s->wake;
}

int64_t usbserver_next_ns(struct usbserver *s)
{
    int64_t next_ns = PORT_NEVER;
    g_mutex_lock(&s->lock);
    for (int i = 0; i < s->devices; i++) {
        const int64_t due_ns = sim_usbtmc_next_ns(&s->device[i].model);
        next_ns = due_ns < next_ns ? due_ns : next_ns;
    }
    g_mutex_unlock(&s->lock);
    return next_ns;
}

void usbserver_step(struct usbserver *s)
{
    uint64_t count;
    ssize_t n = read(s->wake, &count, sizeof count);
    (void)n; // nothing to read: time has come instead
    g_mutex_lock(&s->lock);
    for (int i = 0; i < s->devices; i++)
        pump(&s->device[i]);
    g_mutex_unlock(&s->lock);
}
