// SPDX-License-Identifier: MIT
// What tests/dst/libc.c has to know besides what the program calls. Thread: one.
#pragma once
#include "tests/dst/line.h"

#include <dlfcn.h>

#define LIBC_DEVICES "/dev/dst-" // paths that begin so are lines
enum { LIBC_LINES = 8 };

void libc_add_line(struct line *l); // borrowed until libc_forget
void libc_forget(void);             // all lines and all virtual descriptors

// The call that this program's own hides.
#define REAL(name)                                                                                 \
    __extension__({                                                                                \
        static __typeof__(&name) real_;                                                            \
        if (!real_)                                                                                \
            real_ = (__typeof__(&name))dlsym(RTLD_NEXT, #name);                                    \
        real_;                                                                                     \
    })
