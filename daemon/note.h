// SPDX-License-Identifier: MIT
// What the daemon's threads tell each other: one kind of message with a few fields, of which each
// kind uses those named beside it. A note belongs to whoever holds it.
#pragma once
#include "base/err.h"
#include "base/mail.h"
#include "daemon/engine.h"
#include "daemon/instrument.h"

#include <stdbool.h>
#include <stdint.h>

enum note_kind {
    NOTE_QUIT, // to every worker: end
    // to the store thread
    NOTE_LIST,    // which campaigns are there
    NOTE_CREATE,  // ticket, by, text: config, name: of its file: make a campaign file
    NOTE_LOOK,    // ticket, by, name: path, or run: can this campaign go on
    NOTE_FIND,    // ticket, run: is there such a campaign
    NOTE_OPEN,    // run, name: path: for writing
    NOTE_READING, // run, sequence, thing: struct store_reading
    NOTE_EVENT,   // run, level, source, text
    NOTE_STATE,   // run, state, text: why
    NOTE_FIT,     // run, sweep, last, thing: struct fit_outcome
    NOTE_CLOSE,   // run, state, text: why
    NOTE_QUEUE,   // thing: struct state_queue, to keep
    NOTE_DECIDE,  // ticket, by, run, last: a sweep is to be measured again, thing: struct decision
    NOTE_KEPT,    // ticket, run: status, text: body; comes back when what came before is written
    // to the instrument thread
    NOTE_START,   // run, thing: struct run_material
    NOTE_STORED,  // sequence, err
    NOTE_PAUSE,   // text: by whom, last: now and not at the next point
    NOTE_RESUME,
    NOTE_ACK,     // text: by whom
    NOTE_HALT,    // while no run: laser off, axes stopped
    NOTE_ARM,     // ticket (0: none), name: whose, text: reason, for_s: arm the laser
    NOTE_EXTEND,  // the same, unless it is armed for longer
    NOTE_DISARM,  // ticket, text: why
    NOTE_ALIGN,   // ticket, name: whose, power_w, for_s: an alignment session
    // to the fit thread
    NOTE_FIT_WANTED, // run, sweep, last, name: path
    // to the main thread
    NOTE_RESTORED, // thing: struct state_queue of an earlier life; after the runs, before their end
    NOTE_UNKEPT,   // err: why the queue could not be kept, or (before LISTED's end) not be read
    NOTE_LISTED,   // thing: struct run (one a note); NULL: that was all; err
    NOTE_KNOWN,    // ticket, by, thing: struct run; NULL: err, and text: all complaints
    NOTE_FOUND,    // ticket, run, thing: struct run; NULL: there is none
    NOTE_OPENED,   // run, thing: struct run_material; NULL: err
    NOTE_FITTED,   // run, sweep, last, text: JSON; NULL: err
    NOTE_CLOSED,   // run, last: it was done, but points of it are to be measured again, err
    NOTE_DECIDED,  // ticket, by, run, last: as asked, count: readings, thing: struct run; NULL: err
    NOTE_HAPPENED, // run, event, text; sweep and point: of the last stored reading
    NOTE_FIT_ASKED, // run, sweep, last
    NOTE_ENDED,    // run, state, err
    NOTE_SNAPSHOT, // thing: struct instrument_snapshot
    NOTE_HALTED,   // err
    NOTE_ARMED,    // ticket (0: none), thing: struct arm as it is now, err: why it is not as asked
    NOTE_ALIGNED   // ticket (0: none), thing: struct align as it is now, err: likewise
};

struct note {
    struct letter letter; // kind: note_kind
    int run, sweep, point, count;
    bool last;
    uint64_t ticket, sequence;
    enum run_state state;
    struct gon_error err; // code 0: none
    struct engine_event event; // its text is the note's
    const char *level, *source; // static texts
    double for_s, power_w;
    char *text, *name, *by; // by: whose command
    void *thing;
    void (*drop)(void *thing); // how to free the thing; NULL: free
};

// Ends the program without memory: nothing can be told then.
struct note *note_new(enum note_kind kind);
void note_free(struct note *n);             // NULL is fine
void note_drop(struct letter *l);           // the same, for mail_free
void note_post(struct mail *to, struct note *n);
struct note *note_take(struct mail *m);     // NULL: none
struct note *note_wait(struct mail *m, int timeout_ms); // -1: for ever
char *note_text(const char *text);          // a copy; NULL of NULL
void *note_steal(struct note *n);           // the thing, now the caller's
