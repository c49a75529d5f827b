// SPDX-License-Identifier: MIT
#include "daemon/deadline.h"

#include "base/clk.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

struct deadline {
    double seconds;
    const char *text;
    int status;
};

static void *wait_and_end(void *ctx)
{
    const struct deadline *d = ctx;
    clk_sleep(clk_system(), CLK_S(d->seconds), NULL);
    ssize_t n = write(STDERR_FILENO, d->text, strlen(d->text));
    (void)n;
    _exit(d->status);
}

void deadline_set(double seconds, const char *text, int status)
{
    struct deadline *d = malloc(sizeof *d);
    pthread_t thread;
    if (!d)
        return;
    *d = (struct deadline){seconds, text, status};
    if (pthread_create(&thread, NULL, wait_and_end, d))
        free(d);
    else
        pthread_detach(thread);
}
