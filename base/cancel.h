// SPDX-License-Identifier: MIT
// A cancel token: one thread asks, others see it and wake from their waits. Level, not edge: once
// requested it stays requested until cancel_reset. This and mail are all that threads share.
#pragma once
#include <stdbool.h>

struct cancel;

struct cancel *cancel_new(void); // NULL without memory or descriptors
void cancel_free(struct cancel *c);
void cancel_request(struct cancel *c);         // any thread, also from a signal handler
void cancel_reset(struct cancel *c);           // only while nobody waits on it
bool cancel_requested(const struct cancel *c); // NULL: never requested; costs one relaxed load
int cancel_fd(const struct cancel *c); // readable once requested; NULL: -1, which poll ignores
