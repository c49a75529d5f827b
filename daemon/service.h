// SPDX-License-Identifier: MIT
// What goniod tells the service manager that started it: ready, alive, ending, and one line for
// `systemctl status`. The protocol is sd_notify(3)'s, datagrams to $NOTIFY_SOCKET; without that
// variable everything here does nothing. Thread: main.
#pragma once
#include "base/err.h"

#include <stdint.h>

struct service;

// Takes NOTIFY_SOCKET and WATCHDOG_USEC out of the environment, so that no child speaks for goniod.
// *ret_service is NULL when nobody wants to hear; every call below takes NULL. GON_E_SYSTEM: the
// address is there but cannot be used.
int service_open(struct service **ret_service, struct gon_error *err);
void service_close(struct service *s);

void service_ready(struct service *s);
void service_ending(struct service *s);
// One line for whoever looks; the same again is not sent again.
void service_status(struct service *s, const char *text);
// The time that may pass between two calls of service_alive before goniod is killed; 0: no matter.
int64_t service_watchdog_ns(const struct service *s);
void service_alive(struct service *s);
