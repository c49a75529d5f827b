// SPDX-License-Identifier: MIT
// What goniod and its guard process say to each other: one message is one packet of a
// SOCK_SEQPACKET pair, its first byte says which. Both are of the same build and the same machine,
// so that structs go as they are. Only data; no includes but the language's, as the guard knows no
// profiles.
//
// goniod -> guard                              guard -> goniod
//   R record  whose laser, how to switch off     d            the last R, D or C was done
//   D bytes   one whole command                  e guard_no   it was not, and why
//   A int64   read an answer, for so many ns     b ended,...  bytes from the laser
//             (links with messages: USB)         s guard_status  whenever that changes
//   C int64   forget what was said (USB), silent for so many ns
//   L         the lease goes on
//   X uint32  switch off until that was read back; the number comes back in guard_status.done
// To R, D, A and C there is one answer each: d or e (A: b or e).
//
// The STOP socket (a Unix stream, 0660): a connection means OFF, whatever is written to it. One
// line of answer comes as soon as off was read back ("laser off: read back from LINK"), or when
// there is no laser; nothing while it is not confirmed.
#pragma once
#include <stdbool.h>
#include <stdint.h>

enum {
    GUARD_COMMAND = 64, // bytes of a command of the record, with its terminators
    GUARD_OFFS = 4,
    GUARD_ONS = 8,
    GUARD_ASKS = 4,
    GUARD_REGEX = 400,
    GUARD_LINK = 300,
    GUARD_DATA = 512 // bytes of a D or b
};
#define GUARD_LEASE_NS INT64_C(500000000)
#define GUARD_LATE_NS INT64_C(20000000) // a command may reach the laser so much later than we think

struct guard_bytes {
    uint8_t size;
    char at[GUARD_COMMAND];
};

// A question, and the answers that mean off: a POSIX extended regular expression, letter case does
// not matter, over one line without its terminator. drivers/safing.c makes it of a profile.
struct guard_ask {
    struct guard_bytes question;
    char off[GUARD_REGEX];
};

// Everything that is needed to switch one laser off and to see it.
struct guard_record {
    char link[GUARD_LINK];      // as drivers/link.h
    bool framed;                // the link has messages (USB)
    struct guard_bytes end_out; // ends a command
    struct guard_bytes end_in;  // ends an answer
    uint8_t tail;               // bytes at an answer's end that are not looked at: a checksum
    int64_t gap_ns, timeout_ns, quiet_ns;
    int64_t reopen_ns; // between tries while the port is gone
    bool brief;        // a port that is gone when nobody is there any more is given up (simulators)
    uint8_t offs, ons, asks;
    struct guard_bytes off[GUARD_OFFS]; // in turn, as they go out: with what ends half a command
    struct guard_bytes on[GUARD_ONS];   // what a command begins with that may bring light
    struct guard_ask ask[GUARD_ASKS];
};

enum guard_phase { GUARD_EMPTY, GUARD_DARK, GUARD_LIT, GUARD_SAFING };
enum guard_why { GUARD_START, GUARD_ASKED, GUARD_LEASE, GUARD_STOP, GUARD_SIGNAL, GUARD_GONE };
enum guard_seen {
    GUARD_SEEN_NOTHING,
    GUARD_SEEN_NO_PORT,
    GUARD_SEEN_SILENCE,
    GUARD_SEEN_ON,
    GUARD_SEEN_OFF
};

struct guard_status {
    uint8_t phase; // enum guard_phase; DARK: off was read back, and no ON since
    uint8_t why;   // enum guard_why: the last OFF
    uint8_t seen;  // enum guard_seen: by the last look
    bool latched;  // it went off without being asked: only X is taken, which ends this
    uint32_t done; // the number of the last X that was carried out
};

struct guard_no {
    int32_t code;   // enum gon_code
    char text[300]; // of the transport; "": the guard itself does not want to, see its status
};
