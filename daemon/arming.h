// SPDX-License-Identifier: MIT
// The main thread's side of the arm (daemon/arm.h): asks the instrument thread, which owns it, for
// changes and remembers what that said last. A letter that arms goes before the one that starts.
// Thread: main.
#pragma once
#include "base/err.h"
#include "daemon/align.h"
#include "daemon/arm.h"

#include <stdbool.h>
#include <stdint.h>

struct bench_laser;
struct mail;
struct note;

struct arming {
    const struct bench_laser *rule; // borrowed
    struct mail *to_runner;         // borrowed
    struct arm seen;                // as told last
    struct align align;             // likewise
};

// GON_E_REFUSED: somebody aligns; or on this bench people arm themselves, and nobody has. For commands that start light.
int arming_may_start(const struct arming *a, struct gon_error *err);
// by's command starts light: that arms, where the bench has it so.
void arming_start(struct arming *a, const char *by);
// NOTE_ARMED answers the ticket; 0: nobody waits. for_s 0: as long as the bench file says.
void arming_arm(struct arming *a, const char *name, const char *reason, double for_s,
                uint64_t ticket);
void arming_disarm(struct arming *a, const char *why, uint64_t ticket);
// by's session: in that name it arms for its time, where the bench has it so. NOTE_ALIGNED answers.
void arming_align(struct arming *a, const char *by, double power_w, double for_s, uint64_t ticket);
// A NOTE_ARMED or NOTE_ALIGNED: true when it is news.
bool arming_told(struct arming *a, const struct note *n);
