// SPDX-License-Identifier: MIT
#include "tests/usb/ttyserver.h"

#include <errno.h>
#include <glib.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <umockdev.h>
#include <unistd.h>

struct port_of {
    struct ttyserver *server;
    bool plugged;
    int lines; // of the modem
    unsigned seen;
    char node[32], device[64], sysfs[128];
};

struct ttyserver {
    struct usbserver *usb;
    struct port_of port[TTYSERVER_PORTS];
};

static void die(const char *what)
{
    fprintf(stderr, "ttyserver: %s\n", what);
    exit(1);
}

// --- the modem's lines ---------------------------------------------------------------------------

static void change_lines(struct port_of *p, gulong request, UMockdevIoctlData *arg)
{
    UMockdevIoctlData *data = umockdev_ioctl_data_resolve(arg, 0, sizeof(int), NULL);
    int *lines = (int *)data->data;
    switch (request) {
    case TIOCMGET: *lines = p->lines; break;
    case TIOCMSET: p->lines = *lines; break;
    case TIOCMBIS: p->lines |= *lines; break;
    default: p->lines &= ~*lines; break;
    }
    umockdev_ioctl_data_unref(data);
    p->seen++;
}

// What else a port is told: whose it is.
static gboolean on_ioctl(UMockdevIoctlBase *handler, UMockdevIoctlClient *client, gpointer ctx)
{
    struct port_of *p = ctx;
    const gulong request = umockdev_ioctl_client_get_request(client);
    const bool lines =
        request == TIOCMGET || request == TIOCMSET || request == TIOCMBIS || request == TIOCMBIC;
    const bool known = lines || request == TIOCEXCL || request == TIOCNXCL;
    (void)handler;
    usbserver_lock(p->server->usb);
    if (lines)
        change_lines(p, request, umockdev_ioctl_client_get_arg(client));
    usbserver_unlock(p->server->usb);
    umockdev_ioctl_client_complete(client, known ? 0 : -1, known ? 0 : ENOTTY);
    return true;
}

// --- nodes ---------------------------------------------------------------------------------------

static void add(struct ttyserver *t, const char *text)
{
    GError *error = NULL;
    if (!umockdev_testbed_add_from_string(usbserver_testbed(t->usb), text, &error))
        die(error->message);
}

// As the kernel shows it: the adapter, and its tty three folders below.
static void describe(struct ttyserver *t, const struct port_of *p, const struct tty_adapter *a)
{
    const bool named = g_strcmp0(a->serial, "-") != 0;
    char *text =
        g_strdup_printf("P: %s\nE: SUBSYSTEM=usb\nE: DRIVER=usb\nE: DEVTYPE=usb_device\n"
                        "E: BUSNUM=%03d\nE: DEVNUM=%03d\nA: busnum=%d\\n\nA: devnum=%d\\n\n"
                        "A: idVendor=%04x\\n\nA: idProduct=%04x\\n\n%s%s%s",
                        p->device, a->bus, a->address, a->bus, a->address, a->vendor, a->product,
                        named ? "A: serial=" : "", named ? a->serial : "", named ? "\\n\n" : "");
    add(t, text);
    g_free(text);
    const char *name = p->node + sizeof "/dev/" - 1;
    text = g_strdup_printf("P: %s\nE: SUBSYSTEM=tty\nE: DEVNAME=%s\nL: device=../../../%s\n",
                           p->sysfs, p->node, name);
    add(t, text);
    g_free(text);
}

static void make_node(struct ttyserver *t, struct port_of *p, const char *pty)
{
    GError *error = NULL;
    char *path = g_strconcat(usbserver_dir(t->usb), p->node, NULL);
    char *folder = g_path_get_dirname(path);
    if (g_mkdir_with_parents(folder, 0755) || symlink(pty, path))
        die(path);
    UMockdevIoctlBase *handler = umockdev_ioctl_base_new();
    g_signal_connect(handler, "handle-ioctl", G_CALLBACK(on_ioctl), p);
    if (!umockdev_testbed_attach_ioctl(usbserver_testbed(t->usb), p->node, handler, &error))
        die(error->message);
    g_free(folder);
    g_free(path);
}

void ttyserver_plug(struct ttyserver *t, int number, const struct tty_adapter *a)
{
    struct port_of *p = &t->port[number];
    if (p->plugged)
        return;
    *p = (struct port_of){.server = t, .plugged = true};
    p->lines = TIOCM_CTS | TIOCM_DSR | TIOCM_CAR;
    snprintf(p->node, sizeof p->node, "/dev/ttyUSB%d", number);
    snprintf(p->device, sizeof p->device, "/devices/usb%d/%d-%d", a->bus, a->bus, a->address);
    snprintf(p->sysfs, sizeof p->sysfs, "/devices/usb%d/%d-%d/%d-%d:1.0/ttyUSB%d/tty/ttyUSB%d",
             a->bus, a->bus, a->address, a->bus, a->address, number, number);
    make_node(t, p, a->pty);
    describe(t, p, a);
}

static void take_away(struct ttyserver *t, const char *sysfs)
{
    char path[160];
    snprintf(path, sizeof path, "/sys%s", sysfs);
    umockdev_testbed_uevent(usbserver_testbed(t->usb), path, "remove");
    umockdev_testbed_remove_device(usbserver_testbed(t->usb), path);
}

void ttyserver_unplug(struct ttyserver *t, int number)
{
    struct port_of *p = &t->port[number];
    GError *error = NULL;
    if (!p->plugged)
        return;
    p->plugged = false;
    char *path = g_strconcat(usbserver_dir(t->usb), p->node, NULL);
    unlink(path);
    g_free(path);
    umockdev_testbed_detach_ioctl(usbserver_testbed(t->usb), p->node, &error);
    g_clear_error(&error);
    take_away(t, p->sysfs);
    take_away(t, p->device);
}

unsigned ttyserver_seen(struct ttyserver *t, int number)
{
    usbserver_lock(t->usb);
    const unsigned seen = t->port[number].seen;
    usbserver_unlock(t->usb);
    return seen;
}

// --- all of them ---------------------------------------------------------------------------------

struct ttyserver *ttyserver_new(struct usbserver *s)
{
    struct ttyserver *t = calloc(1, sizeof *t);
    if (!t)
        die("out of memory");
    t->usb = s;
    return t;
}

void ttyserver_free(struct ttyserver *t)
{
    for (int i = 0; i < TTYSERVER_PORTS; i++)
        ttyserver_unplug(t, i);
    free(t);
}
