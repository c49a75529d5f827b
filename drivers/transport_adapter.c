// SPDX-License-Identifier: MIT
#include "drivers/transport_adapter.h"

#include <libserialport.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool describe(const struct sp_port *port, struct adapter *ret_adapter)
{
    int vendor, product;
    if (sp_get_port_transport(port) != SP_TRANSPORT_USB ||
        sp_get_port_usb_vid_pid(port, &vendor, &product) != SP_OK)
        return false;
    const char *serial = sp_get_port_usb_serial(port);
    *ret_adapter = (struct adapter){.vendor = (uint16_t)vendor, .product = (uint16_t)product};
    snprintf(ret_adapter->name, sizeof ret_adapter->name, "%s", sp_get_port_name(port));
    snprintf(ret_adapter->serial, sizeof ret_adapter->serial, "%s", serial ? serial : "");
    return true;
}

// "/dev/ttyUSB9" before "/dev/ttyUSB10".
static int by_name(const void *a, const void *b)
{
    return strverscmp(((const struct adapter *)a)->name, ((const struct adapter *)b)->name);
}

int transport_adapters(struct adapter ret_adapters[ADAPTERS_MOST])
{
    struct sp_port **ports;
    int count = 0;
    if (sp_list_ports(&ports) != SP_OK)
        return 0;
    for (int i = 0; ports[i] && count < ADAPTERS_MOST; i++)
        count += describe(ports[i], &ret_adapters[count]);
    sp_free_port_list(ports);
    qsort(ret_adapters, (size_t)count, sizeof *ret_adapters, by_name);
    return count;
}

void transport_adapter_link(const struct adapter *a, char ret_text[ADAPTER_LINK])
{
    snprintf(ret_text, ADAPTER_LINK, "usb-%04x:%04x%s%s", a->vendor, a->product,
             *a->serial ? ":" : "", a->serial);
}

static bool fits(const struct adapter *a, const struct link *l)
{
    const char *wanted = link_serial_number(l);
    return a->vendor == l->vendor && a->product == l->product &&
           (!*wanted || strcmp(wanted, a->serial) == 0);
}

static void add(char *text, size_t size, const struct adapter *a)
{
    char link[ADAPTER_LINK];
    const size_t used = strlen(text);
    transport_adapter_link(a, link);
    if (used + strlen(link) + strlen(a->name) + 6 < size)
        snprintf(text + used, size - used, "%s%s (%s)", used ? ", " : "", link, a->name);
}

static int say_none(const struct link *l, const struct adapter *all, int count,
                    struct gon_error *err)
{
    char text[400] = "";
    for (int i = 0; i < count; i++)
        add(text, sizeof text, &all[i]);
    return gon_fail(err, GON_E_GONE, "%s: no such port: no adapter with these numbers; %s%s",
                    l->place, *text ? "there is " : "no USB serial adapter is plugged in", text);
}

// Telling them apart takes a serial number, if they differ in that.
static int say_several(const struct link *l, const struct adapter *all, int count,
                       struct gon_error *err)
{
    char text[400] = "";
    const struct adapter *first = NULL;
    bool differ = false;
    int alike = 0;
    for (int i = 0; i < count; i++) {
        if (!fits(&all[i], l))
            continue;
        add(text, sizeof text, &all[i]);
        first = first ? first : &all[i];
        differ |= strcmp(first->serial, all[i].serial) != 0;
        alike++;
    }
    return gon_fail(err, GON_E_INPUT, "%s: %d ports have these numbers: %s; %s", l->place, alike,
                    text,
                    differ ? "give the serial number too"
                           : "they differ only by their place: give a path in /dev/serial/by-path");
}

int transport_adapter_find(const struct link *link, char *ret_name, size_t size,
                           struct gon_error *err)
{
    struct adapter all[ADAPTERS_MOST];
    const struct adapter *found = NULL;
    const int count = transport_adapters(all);
    int fitting = 0;
    for (int i = 0; i < count; i++)
        if (fits(&all[i], link)) {
            found = &all[i];
            fitting++;
        }
    if (!found)
        return say_none(link, all, count, err);
    if (fitting > 1)
        return say_several(link, all, count, err);
    snprintf(ret_name, size, "%s", found->name);
    return 0;
}
