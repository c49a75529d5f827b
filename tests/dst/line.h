// SPDX-License-Identifier: MIT
// A wire between the program and a simulated instrument, with all that happens to bytes on wires.
// A serial line is a path that can be opened, a TCP one an address that can be connected to. What
// the program writes reaches the instrument at once, what that answers waits here until it is due.
// Thread: one.
#pragma once
#include "sim/port.h"
#include "tests/dst/os.h"

#include <stddef.h>
#include <sys/types.h>

enum { LINE_CHUNKS = 96, LINE_IN = 1 << 16, LINE_LISTS = 6 };

// Of the next answer (LINE_DEAF: the next request) that it fits.
enum line_fault {
    LINE_GOOD,
    LINE_LOST,
    LINE_LATE,
    LINE_DOUBLED,
    LINE_CUT,
    LINE_SPLIT,
    LINE_MERGED, // held back until the next answer, with which it comes
    LINE_BEFORE, // garbage in front
    LINE_AFTER,
    LINE_FLIPPED,    // a bit; links with a checksum
    LINE_DEAF,       // the request never arrives
    LINE_WRONG_UNIT, // Modbus, with a checksum that is right
    LINE_WRONG_FUNCTION,
    LINE_STALE_NUMBER, // Modbus TCP: transaction of the request before
    LINE_WRONG_ECHO,   // of a write: another address
    LINE_COMMA,        // text: decimal comma
    LINE_NO_NUMBER,    // text: nan, inf, 9.9E37, OVLD, nothing
    LINE_ECHO,         // text: the command comes back
    LINE_ENDLESS,      // text: 6000 bytes without an end
    LINE_FAULTS
};

extern const char *const line_fault_names[LINE_FAULTS];

struct line {
    const char *name;
    const char *path; // "/dev/dst-laser"; NULL: TCP
    uint32_t address; // TCP, host order
    struct port *device;
    bool modbus;
    struct dice dice;
    // the connection
    int fd;             // -1: none
    bool hung;          // pulled out, or closed by the other end
    int reset;          // errno of the next read; 0: end of file when hung
    bool away;          // cannot be opened
    bool hole;          // bytes vanish, both ways
    int64_t unheard_ns; // since when bytes vanish without an acknowledgement; 0: none
    // faults to come
    enum line_fault next;
    int left;                                  // so many times
    const char *number;                        // LINE_NO_NUMBER
    int64_t late_ns;                           // LINE_LATE, LINE_DOUBLED: by so much
    bool stuck;                                // text: lists of values are those of before
    uint8_t kept[LINE_LISTS][PORT_REPLY_MOST]; // by the number of commas
    size_t kept_size[LINE_LISTS];
    uint64_t hits;  // faults that struck
    int64_t hit_ns; // the last one
    // bytes
    uint8_t command[300]; // the last that was written
    size_t command_size;
    struct line_chunk {
        int64_t due_ns;
        size_t size;
        uint8_t bytes[PORT_REPLY_MOST];
    } chunk[LINE_CHUNKS];
    int chunks;
    uint8_t held[PORT_REPLY_MOST];
    size_t held_size;
    uint8_t in[LINE_IN];
    size_t have;
    int64_t answer_ns; // when an undisturbed answer last came
    // told of what reached the instrument, after it was carried out; may be NULL
    void (*heard)(void *ctx, const uint8_t *bytes, size_t size);
    void *ctx;
};

void line_init(struct line *l, const char *name, const char *path, uint32_t address,
               struct port *device, bool modbus, uint64_t seed);

// What libc's calls do; errno is set.
bool line_open(struct line *l, int fd);
void line_close(struct line *l);
ssize_t line_write(struct line *l, const void *bytes, size_t size);
ssize_t line_read(struct line *l, void *bytes, size_t size);
void line_flush(struct line *l);
short line_revents(struct line *l, short events);
bool line_readable(void *line);   // at os.now_ns
int64_t line_next_ns(void *line); // when that may change

void line_disturb(struct line *l, enum line_fault fault, int times);
void line_pull(struct line *l, int error, bool away); // error 0: end of file
void line_plug(struct line *l);
bool line_is_clean(const struct line *l); // nothing is wrong with it, and nothing is to come
