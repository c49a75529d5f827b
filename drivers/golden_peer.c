// SPDX-License-Identifier: MIT
#include "drivers/golden_peer.h"

#include "base/clk.h"
#include "drivers/checksum.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#define TURN_MS 5
#define WAIT_NS CLK_MS(100) // for what was written last

struct golden_peer {
    struct golden_script script;
    int master, slave; // slave: so that the master is not hung up while nobody has opened it
    char path[64];
    pthread_t thread;
    // All of what is shown; no more is wanted; the thread has hung up.
    atomic_bool heard, ended, over;
    struct golden_bytes got;
    int requests;
};

static void answer(struct golden_peer *g, const struct golden_bytes *b)
{
    size_t done = 0;
    while (done < b->size) {
        const ssize_t n = write(g->master, b->byte + done, b->size - done);
        if (n <= 0)
            return;
        done += (size_t)n;
    }
}

static bool is_as_shown(const struct golden_peer *g)
{
    return g->got.size == g->script.sent.size &&
           memcmp(g->got.byte, g->script.sent.byte, g->got.size) == 0;
}

// --- Modbus --------------------------------------------------------------------------------------

// Of a request; 0: not known before more of it has come.
static size_t frame_size(const struct golden_bytes *b)
{
    if (b->size < 8)
        return 0;
    return b->byte[1] == 15 || b->byte[1] == 16 ? (size_t)b->byte[6] + 9 : 8;
}

void golden_bytes_add_crc(struct golden_bytes *b)
{
    static const struct profile_checksum crc = {.kind = PROFILE_CRC,
                                                .width = 16,
                                                .polynomial = 0x8005,
                                                .initial = 0xffff,
                                                .reflect_in = true,
                                                .reflect_out = true};
    if (b->size + 2 > sizeof b->byte)
        return;
    const uint32_t sum = checksum_of(&crc, b->byte, b->size);
    b->byte[b->size++] = (uint8_t)sum;
    b->byte[b->size++] = (uint8_t)(sum >> 8);
}

// What a unit answers to a write: its first six bytes.
static void acknowledge(struct golden_peer *g)
{
    struct golden_bytes b = {.size = 6};
    memcpy(b.byte, g->got.byte, 6);
    golden_bytes_add_crc(&b);
    if (g->got.byte[1] == 5 || g->got.byte[1] == 6 || g->got.byte[1] == 15 || g->got.byte[1] == 16)
        answer(g, &b);
}

// False: another request than the one shown; that is kept.
static bool take_frame(struct golden_peer *g)
{
    if (g->requests++ != g->script.shown) {
        acknowledge(g);
    } else {
        if (!is_as_shown(g))
            return false;
        answer(g, &g->script.received);
        g->heard = true;
    }
    g->got.size = 0;
    return true;
}

// --- hearing -------------------------------------------------------------------------------------

static bool hear(struct golden_peer *g)
{
    if (g->script.rtu) {
        const size_t size = frame_size(&g->got);
        return size == 0 || g->got.size < size || take_frame(g);
    }
    if (!g->heard && is_as_shown(g)) {
        answer(g, &g->script.received);
        g->heard = true;
    }
    return true;
}

// Another line than the one shown, or nothing to be said to it: waiting on would tell no more.
static bool is_over(const struct golden_peer *g, bool going)
{
    const struct golden_bytes *got = &g->got, *shown = &g->script.sent;
    const bool differs =
        g->script.rtu ? !going
                      : got->size > shown->size || memcmp(got->byte, shown->byte, got->size) != 0;
    return differs || (g->heard && g->script.received.size == 0);
}

// Hangs up at its end, so that nobody waits for an answer.
static void *play(void *arg)
{
    struct golden_peer *g = arg;
    bool going = true;
    while (!g->ended) {
        struct pollfd p = {g->master, POLLIN, 0};
        uint8_t bytes[64];
        const int ready = poll(&p, 1, TURN_MS);
        if (ready == 0 && is_over(g, going))
            break;
        const ssize_t n = ready > 0 ? read(g->master, bytes, sizeof bytes) : 0;
        for (ssize_t i = 0; i < n && going && g->got.size < GOLDEN_BYTES; i++) {
            g->got.byte[g->got.size++] = bytes[i];
            going = hear(g);
        }
    }
    close(g->master);
    g->over = true;
    return NULL;
}

// --- life ----------------------------------------------------------------------------------------

static int open_pair(struct golden_peer *g, struct gon_error *err)
{
    struct termios t;
    g->slave = -1;
    g->master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (g->master >= 0 && grantpt(g->master) == 0 && unlockpt(g->master) == 0 &&
        ptsname_r(g->master, g->path, sizeof g->path) == 0)
        g->slave = open(g->path, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (g->slave < 0 || tcgetattr(g->slave, &t) < 0)
        return gon_fail(err, GON_E_SYSTEM, "no pseudo-terminal to play golden entries on: %s",
                        strerror(errno));
    cfmakeraw(&t);
    tcsetattr(g->slave, TCSANOW, &t);
    return 0;
}

int golden_peer_start(const struct golden_script *script, struct golden_peer **ret_peer,
                      struct gon_error *err)
{
    struct golden_peer *g = calloc(1, sizeof *g);
    if (!g)
        return gon_fail(err, GON_E_SYSTEM, "out of memory");
    g->script = *script;
    int rc = open_pair(g, err);
    if (rc == 0 && pthread_create(&g->thread, NULL, play, g) != 0)
        rc = gon_fail(err, GON_E_SYSTEM, "no thread to play golden entries in");
    if (rc < 0) {
        if (g->slave >= 0)
            close(g->slave);
        if (g->master >= 0)
            close(g->master);
        free(g);
        return rc;
    }
    *ret_peer = g;
    return 0;
}

const char *golden_peer_path(const struct golden_peer *peer)
{
    return peer->path;
}

static void show_byte(uint8_t c, bool hex, char ret_text[8])
{
    if (hex)
        snprintf(ret_text, 8, "%02X ", c);
    else if (c == '\r' || c == '\n')
        snprintf(ret_text, 8, "\\%c", c == '\r' ? 'r' : 'n');
    else if (c < ' ' || c >= 0x7f)
        snprintf(ret_text, 8, "\\x%02x", c);
    else
        snprintf(ret_text, 8, "%c", c);
}

void golden_bytes_show(const struct golden_bytes *b, bool hex, char *out, size_t size)
{
    size_t used = 0;
    *out = 0;
    for (size_t i = 0; i < b->size && used + 8 < size; i++) {
        show_byte(b->byte[i], hex, out + used);
        used += strlen(out + used);
    }
    if (hex && used > 0)
        out[used - 1] = 0; // the last blank
}

static int differs(const struct golden_peer *g, struct gon_error *err)
{
    const struct golden_bytes *got = &g->got, *expected = &g->script.sent;
    char a[180], b[180];
    size_t at = 0;
    while (at < got->size && at < expected->size && got->byte[at] == expected->byte[at])
        at++;
    golden_bytes_show(got, g->script.rtu, a, sizeof a);
    golden_bytes_show(expected, g->script.rtu, b, sizeof b);
    return gon_fail(err, GON_E_INPUT, "sent: got %s / expected %s / at byte %zu",
                    *a ? a : "nothing", b, at);
}

int golden_peer_finish(struct golden_peer *peer, struct gon_error *err)
{
    struct clk *clk = clk_system();
    const int64_t end_ns = clk_now_ns(clk) + WAIT_NS;
    while (!peer->heard && !peer->over && clk_now_ns(clk) < end_ns)
        clk_sleep(clk, CLK_MS(1), NULL);
    peer->ended = true;
    pthread_join(peer->thread, NULL);
    // A line that went on behind what is shown is another one.
    const bool same = peer->heard && (peer->script.rtu || is_as_shown(peer));
    int rc = same ? 0 : differs(peer, err);
    close(peer->slave);
    free(peer);
    return rc;
}
