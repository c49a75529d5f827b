// SPDX-License-Identifier: MIT
#include "tests/dst/line.h"

#include "sim/modbus.h"

#include <assert.h>
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>

#define DEAD_NS OS_S(5) // TCP_USER_TIMEOUT

const char *const line_fault_names[LINE_FAULTS] = {
    "good",          "lost",       "late",           "doubled",        "cut",
    "split",         "merged",     "garbage first",  "garbage behind", "bit flipped",
    "request lost",  "wrong unit", "wrong function", "stale number",   "wrong echo",
    "decimal comma", "no number",  "echo",           "endless"};

void line_init(struct line *l, const char *name, const char *path, uint32_t address,
               struct port *device, bool modbus, uint64_t seed)
{
    memset(l, 0, sizeof *l);
    l->name = name;
    l->path = path;
    l->address = address;
    l->device = device;
    l->modbus = modbus;
    l->dice = dice_of(seed, 100 + (uint64_t)(unsigned char)name[0]);
    l->fd = -1;
}

// --- answers on their way ------------------------------------------------------------------------

static void queue(struct line *l, const void *bytes, size_t size, int64_t due_ns)
{
    if (size == 0 || l->chunks == LINE_CHUNKS)
        return;
    int at = l->chunks++;
    for (; at > 0 && l->chunk[at - 1].due_ns > due_ns; at--)
        l->chunk[at] = l->chunk[at - 1];
    l->chunk[at].due_ns = due_ns;
    l->chunk[at].size = size;
    memcpy(l->chunk[at].bytes, bytes, size);
}

// On a line without a checksum noise that happens to be digits cannot be told from an answer by
// anybody; there it is what a wrong bit rate looks like.
static void queue_garbage(struct line *l, int64_t due_ns)
{
    uint8_t bytes[7];
    const size_t size = 1 + dice_below(&l->dice, sizeof bytes);
    for (size_t i = 0; i < size; i++)
        bytes[i] =
            (uint8_t)(l->modbus ? dice_below(&l->dice, 256) : 128 + dice_below(&l->dice, 128));
    queue(l, bytes, size, due_ns);
}

static void queue_split(struct line *l, const uint8_t *bytes, size_t size, int64_t due_ns)
{
    const size_t step = 1 + size / 40;
    for (size_t i = 0; i < size; i += step)
        queue(l, bytes + i, size - i < step ? size - i : step, due_ns + (int64_t)i * 300000);
}

static void seal(struct line *l, uint8_t *frame, size_t size)
{
    if (!l->path)
        return;
    const uint16_t crc = sim_modbus_crc(frame, size - 2);
    frame[size - 2] = (uint8_t)crc;
    frame[size - 1] = (uint8_t)(crc >> 8);
}

// Whether a fault is one of this answer at all.
static bool fits(const struct line *l, const uint8_t *bytes, size_t size)
{
    const size_t header = l->path ? 1 : 7;
    switch (l->next) {
    case LINE_GOOD:
    case LINE_DEAF: return false;
    case LINE_FLIPPED: return l->modbus && l->path;
    case LINE_WRONG_UNIT:
    case LINE_WRONG_FUNCTION: return l->modbus;
    case LINE_STALE_NUMBER: return l->modbus && !l->path;
    case LINE_WRONG_ECHO: return l->modbus && size > header + 4 && bytes[header] == 16;
    case LINE_COMMA: return !l->modbus && memchr(bytes, '.', size);
    case LINE_NO_NUMBER: return !l->modbus && memchr(bytes, '.', size) && memchr(bytes, ',', size);
    case LINE_ECHO:
    case LINE_ENDLESS: return !l->modbus;
    default: return true;
    }
}

static void queue_text(struct line *l, const char *text, const uint8_t *bytes, size_t size,
                       int64_t due_ns)
{
    uint8_t line[PORT_REPLY_MOST];
    const uint8_t *rest = memchr(bytes, ',', size); // the other values stay
    const size_t tail = rest ? size - (size_t)(rest - bytes) : 0, head = strlen(text);
    memcpy(line, text, head);
    if (tail)
        memcpy(line + head, rest, tail);
    queue(l, line, head + tail, due_ns);
}

static void answer_badly(struct line *l, uint8_t *bytes, size_t size, int64_t due_ns)
{
    const size_t header = l->path ? 1 : 7;
    switch (l->next) {
    case LINE_LOST: return;
    case LINE_LATE: due_ns += l->late_ns; break;
    case LINE_DOUBLED:
        queue(l, bytes, size, due_ns);
        due_ns += l->late_ns;
        break;
    case LINE_CUT: size = dice_below(&l->dice, (unsigned)size); break;
    case LINE_SPLIT: queue_split(l, bytes, size, due_ns); return;
    case LINE_MERGED:
        memcpy(l->held, bytes, size);
        l->held_size = size;
        return;
    case LINE_BEFORE: queue_garbage(l, due_ns); break;
    case LINE_AFTER:
        queue(l, bytes, size, due_ns);
        queue_garbage(l, due_ns);
        return;
    case LINE_FLIPPED: {
        const unsigned bit = dice_below(&l->dice, (unsigned)size * 8);
        bytes[bit / 8] ^= (uint8_t)(1 << bit % 8);
        break;
    }
    case LINE_WRONG_UNIT:
        bytes[header - 1] = (uint8_t)(bytes[header - 1] % 3 + 1);
        seal(l, bytes, size);
        break;
    case LINE_WRONG_FUNCTION:
        bytes[header] = bytes[header] == 3 ? 4 : 3;
        seal(l, bytes, size);
        break;
    case LINE_STALE_NUMBER: bytes[1]--; break;
    case LINE_WRONG_ECHO:
        bytes[header + 2] ^= 2;
        seal(l, bytes, size);
        break;
    case LINE_COMMA: *(uint8_t *)memchr(bytes, '.', size) = ','; break;
    case LINE_NO_NUMBER: queue_text(l, l->number, bytes, size, due_ns); return;
    case LINE_ECHO: queue(l, l->command, l->command_size, due_ns); break;
    case LINE_ENDLESS:
        memset(bytes, 'x', PORT_REPLY_MOST);
        for (int i = 0; i < 20; i++)
            queue(l, bytes, PORT_REPLY_MOST, due_ns);
        return;
    default: break;
    }
    queue(l, bytes, size, due_ns);
}

static void hit(struct line *l)
{
    l->hits++;
    l->hit_ns = os.now_ns;
    os_trace(l->name, '!', line_fault_names[l->next], strlen(line_fault_names[l->next]));
    if (--l->left <= 0)
        l->next = LINE_GOOD;
}

// A converter that hangs says the same again.
static void repeat_list(struct line *l, uint8_t *bytes, size_t *size)
{
    int commas = 0;
    for (size_t i = 0; i < *size; i++)
        commas += bytes[i] == ',';
    if (commas == 0 || commas >= LINE_LISTS)
        return;
    if (l->stuck && l->kept_size[commas]) {
        memcpy(bytes, l->kept[commas], l->kept_size[commas]);
        *size = l->kept_size[commas];
    }
    memcpy(l->kept[commas], bytes, *size);
    l->kept_size[commas] = *size;
}

static void answer(struct line *l, uint8_t *bytes, size_t size, int64_t due_ns)
{
    if (l->hole)
        return;
    if (!l->modbus)
        repeat_list(l, bytes, &size);
    if (fits(l, bytes, size)) {
        answer_badly(l, bytes, size, due_ns);
        hit(l);
        return;
    }
    if (l->held_size) {
        queue(l, l->held, l->held_size, due_ns);
        l->held_size = 0;
    }
    queue(l, bytes, size, due_ns);
    l->answer_ns = due_ns;
}

static void collect(struct line *l)
{
    uint8_t bytes[PORT_REPLY_MOST];
    struct port *p = l->device;
    int64_t due_ns;
    while (p->count > 0) {
        const size_t size = port_take(p, p->queue[p->first].due_ns, bytes, &due_ns);
        if (size == 0)
            break;
        answer(l, bytes, size, due_ns > os.now_ns ? due_ns : os.now_ns);
    }
}

// What has arrived by now. A connection that was not acknowledged for too long ends.
static void arrive(struct line *l)
{
    int n = 0;
    while (n < l->chunks && l->chunk[n].due_ns <= os.now_ns) {
        const struct line_chunk *c = &l->chunk[n++];
        if (l->fd < 0 || l->hung || l->have + c->size > sizeof l->in)
            continue;
        memcpy(l->in + l->have, c->bytes, c->size);
        l->have += c->size;
        os_trace(l->name, '<', c->bytes, c->size);
    }
    if (n > 0)
        memmove(l->chunk, l->chunk + n, (size_t)(l->chunks -= n) * sizeof *l->chunk);
    if (!l->path && l->unheard_ns && !l->hung && os.now_ns >= l->unheard_ns + DEAD_NS)
        line_pull(l, ETIMEDOUT, false);
}

// --- libc ----------------------------------------------------------------------------------------

bool line_open(struct line *l, int fd)
{
    if (l->away) {
        errno = l->path ? ENOENT : ECONNREFUSED;
        return false;
    }
    if (l->fd >= 0) {
        errno = EBUSY;
        return false;
    }
    l->fd = fd;
    l->hung = false;
    l->reset = 0;
    l->have = 0;
    l->unheard_ns = 0;
    if (!l->path) { // what was under way belonged to another connection
        l->chunks = 0;
        l->held_size = 0;
        port_hangup(l->device);
    }
    os_trace(l->name, '+', "", 0);
    return true;
}

void line_close(struct line *l)
{
    os_trace(l->name, '-', "", 0);
    l->fd = -1;
    l->have = 0;
}

ssize_t line_write(struct line *l, const void *bytes, size_t size)
{
    if (l->hung) {
        errno = l->path ? EIO : l->reset ? l->reset : EPIPE;
        return -1;
    }
    os_trace(l->name, '>', bytes, size);
    l->command_size = size < sizeof l->command ? size : sizeof l->command;
    memcpy(l->command, bytes, l->command_size);
    if (l->hole) {
        if (!l->unheard_ns)
            l->unheard_ns = os.now_ns;
        return (ssize_t)size;
    }
    l->unheard_ns = 0;
    if (l->next == LINE_DEAF) {
        hit(l);
        return (ssize_t)size;
    }
    port_feed(l->device, bytes, size, os.now_ns);
    if (l->heard)
        l->heard(l->ctx, bytes, size);
    collect(l);
    if (os.on_step)
        os.on_step(os.ctx, os.now_ns);
    return (ssize_t)size;
}

ssize_t line_read(struct line *l, void *bytes, size_t size)
{
    arrive(l);
    if (l->have == 0 && l->hung && !l->reset)
        return 0;
    if (l->have == 0) {
        errno = l->hung ? l->reset : EAGAIN;
        return -1;
    }
    const size_t n = size < l->have ? size : l->have;
    memcpy(bytes, l->in, n);
    memmove(l->in, l->in + n, l->have - n);
    l->have -= n;
    return (ssize_t)n;
}

void line_flush(struct line *l)
{
    arrive(l);
    l->have = 0;
}

bool line_readable(void *line)
{
    struct line *l = line;
    arrive(l);
    return l->have > 0 || l->hung;
}

int64_t line_next_ns(void *line)
{
    const struct line *l = line;
    const int64_t due_ns = l->chunks ? l->chunk[0].due_ns : OS_NEVER;
    const int64_t dead_ns =
        !l->path && l->unheard_ns && !l->hung ? l->unheard_ns + DEAD_NS : OS_NEVER;
    return due_ns < dead_ns ? due_ns : dead_ns;
}

short line_revents(struct line *l, short events)
{
    short revents = 0;
    if (line_readable(l))
        revents |= (short)(events & POLLIN);
    if (l->hung)
        revents |= (short)(POLLHUP | (l->reset ? POLLERR : 0));
    else
        revents |= (short)(events & POLLOUT);
    return revents;
}

// --- what happens to it --------------------------------------------------------------------------

void line_disturb(struct line *l, enum line_fault fault, int times)
{
    l->next = fault;
    l->left = times;
}

void line_pull(struct line *l, int error, bool away)
{
    os_trace(l->name, '!', "pulled", 6);
    l->away = away;
    l->hung = l->fd >= 0;
    l->reset = error;
    l->chunks = 0;
    l->held_size = 0;
    l->have = 0;
    l->hit_ns = os.now_ns;
    l->hits++;
}

void line_plug(struct line *l)
{
    l->away = l->hole = false;
    l->hit_ns = os.now_ns;
    os_trace(l->name, '!', "plugged", 7);
}

bool line_is_clean(const struct line *l)
{
    return l->next == LINE_GOOD && !l->away && !l->hole && !l->hung;
}
