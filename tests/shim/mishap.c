// SPDX-License-Identifier: MIT
// What happens to goniod in tests only, preloaded: on SIGUSR1 the thread that gets it hangs for
// ever in a loop; on SIGUSR2 the process ends as if somebody had called exit(0).
#include <signal.h>
#include <stddef.h>
#include <stdlib.h>

static void hang(int signal)
{
    (void)signal;
    for (volatile int i = 0;; i++)
        ;
}

static void leave(int signal)
{
    (void)signal;
    _Exit(0);
}

__attribute__((constructor)) static void begin(void)
{
    unsetenv("LD_PRELOAD"); // not of goniod's children
    sigaction(SIGUSR1, &(struct sigaction){.sa_handler = hang}, NULL);
    sigaction(SIGUSR2, &(struct sigaction){.sa_handler = leave}, NULL);
}
