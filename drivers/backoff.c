// SPDX-License-Identifier: MIT
#include "drivers/backoff.h"

bool backoff_due(const struct backoff *b, int64_t now_ns)
{
    return b->wait_ns == 0 || now_ns >= b->next_ns;
}

void backoff_failed(struct backoff *b, int64_t now_ns)
{
    b->wait_ns = b->wait_ns ? 2 * b->wait_ns : BACKOFF_LEAST_NS;
    if (b->wait_ns > BACKOFF_MOST_NS)
        b->wait_ns = BACKOFF_MOST_NS;
    b->next_ns = now_ns + b->wait_ns;
}

void backoff_reset(struct backoff *b)
{
    *b = (struct backoff){0};
}
