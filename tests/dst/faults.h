// SPDX-License-Identifier: MIT
// The table of faults: what is done to wires, devices, disk and clocks, by what it is mended, and
// the reaction that must be seen from outside. The numbers are those of the project's list of
// faults; M: motion, S: serial lines, L: laser, D: detector, H: host. Rows of it that cannot be
// done to this bench are named in faults_elsewhere. Thread: one.
#pragma once
#include <stdbool.h>
#include <stdint.h>

struct trial;

// What must be seen. Each includes that the campaign is complete in the end.
enum reaction {
    REACT_GOES_ON, // at most a pause that ends by itself
    REACT_RETURNS, // a pause that ends by itself
    REACT_REPEATS, // a reading is kept with a flag and made again
    REACT_HOMES,   // stops, homes again, and goes on
    REACT_PAUSES,  // until an operator comes
    REACT_WARNS,   // pauses with the words LASER MAY BE ON, and off once it obeys
    REACT_STOPS    // ends as asked, and can be resumed
};

extern const char *const reaction_names[];

enum fault_needs {
    NEEDS_NOTHING = 0,
    NEEDS_TCP = 1 << 0, // of its line
    NEEDS_SERIAL = 1 << 1,
    NEEDS_AZ = 1 << 2,
    NEEDS_LIGHT = 1 << 3 // does nothing while the laser is off
};

struct fault {
    const char *id, *what;
    enum reaction reaction;
    unsigned needs;
    int line; // enum rig_line that NEEDS_TCP and NEEDS_SERIAL speak of
    void (*begin)(struct trial *t, int variant);
    void (*mend)(struct trial *t); // NULL: it is over at once
    double hold_s;                 // mended after so long; 0: by the operator
    const char *words;             // in the reason of the pause; NULL: any
    const char *not_yet; // what the product does instead of the reaction; NULL: it does it
    bool matrix_only;    // not_yet, and the campaign's rules would break
};

extern const struct fault faults[];
int faults_count(void);

struct fault_elsewhere {
    const char *ids, *why;
};
extern const struct fault_elsewhere faults_elsewhere[]; // ids NULL at the end

bool fault_fits(const struct fault *f, const struct trial *t);
void fault_begin(struct trial *t, int index, int variant);
void faults_mend(struct trial *t, bool all); // what an operator mends; or all there is
