// SPDX-License-Identifier: MIT
#include "drivers/bus.h"

#include "drivers/link.h"
#include "drivers/transport.h"
#include "drivers/transport_modbus.h"

#include <assert.h>
#include <stdbool.h>
#include <stdlib.h>

#define READ_TRIES 3
#define TIMEOUT_MOST_MS 200
#define QUIET_MOST_MS 5000
#define GAP_LEAST_NS 1750000
#define BUSY_FIRST_NS CLK_MS(10) // doubles
#define BUSY_MOST_NS CLK_S(1)

struct bus {
    struct transport *t;
    struct modbus_master *master;
    struct clk *clk;
    const struct cancel *cancel;
    bool rtu, out_of_step;
    int timeout_ms, quiet_ms;
    int64_t gap_ns, ready_ns; // silence between frames; the next request not before
    int exception; // of the last answer
};

// One request, to be carried out and to be named in messages.
struct request {
    int unit, function, address, count;
    uint16_t *ret_registers;   // reading
    const uint16_t *registers; // writing
};

// 3.5 characters of 11 bits, but never less than 1.75 ms (the standard's fixed value above 19200
// baud).
static int64_t silent_gap_ns(const struct link *l)
{
    if (l->kind != LINK_SERIAL)
        return 0;
    const int64_t gap_ns = (int64_t)(3.5 * 11 * 1e9 / l->baud);
    return gap_ns > GAP_LEAST_NS ? gap_ns : GAP_LEAST_NS;
}

int bus_open(const char *link, int timeout_ms, int quiet_ms, struct clk *clk,
             const struct cancel *cancel, struct bus **ret_bus, struct gon_error *err)
{
    struct link l;
    int rc = link_parse(link, LINK_MODBUS, &l, err);
    if (rc < 0)
        return rc;
    if (timeout_ms < 10 || timeout_ms > TIMEOUT_MOST_MS || quiet_ms < 20 ||
        quiet_ms > QUIET_MOST_MS)
        return gon_fail(err, GON_E_INPUT,
                        "%s: timeout %d ms, quiet %d ms; allowed: 10..%d ms and 20..%d ms", link,
                        timeout_ms, quiet_ms, TIMEOUT_MOST_MS, QUIET_MOST_MS);
    struct bus *b = calloc(1, sizeof *b);
    if (!b)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    *b = (struct bus){.clk = clk,
                      .cancel = cancel,
                      .rtu = l.kind == LINK_SERIAL,
                      .timeout_ms = timeout_ms,
                      .quiet_ms = quiet_ms,
                      .gap_ns = silent_gap_ns(&l),
                      .ready_ns = clk_now_ns(clk)};
    rc = transport_open_parsed(&l, link, clk, cancel, &b->t, err);
    if (rc == 0 && !(b->master = modbus_master_new(b->t, b->rtu, timeout_ms)))
        rc = gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    if (rc == 0)
        rc = modbus_master_attach(b->master, err);
    if (rc < 0) {
        bus_close(b);
        return rc;
    }
    *ret_bus = b;
    return 0;
}

void bus_close(struct bus *b)
{
    if (!b)
        return;
    modbus_master_free(b->master);
    transport_close(b->t);
    free(b);
}

static int raised(int now, int wish, int most)
{
    const int wanted = wish < most ? wish : most;
    return wanted > now ? wanted : now;
}

void bus_expect(struct bus *b, int timeout_ms, int quiet_ms)
{
    b->timeout_ms = raised(b->timeout_ms, timeout_ms, TIMEOUT_MOST_MS);
    b->quiet_ms = raised(b->quiet_ms, quiet_ms, QUIET_MOST_MS);
    modbus_master_set_timeout(b->master, b->timeout_ms);
}

int bus_reopen(struct bus *b, struct gon_error *err)
{
    int rc = transport_reopen(b->t, err);
    if (rc < 0)
        return rc;
    b->out_of_step = b->rtu; // another's request may still be under way on the line
    b->ready_ns = clk_now_ns(b->clk);
    return modbus_master_attach(b->master, err);
}

// Makes sure that the next bytes to come answer the next request.
static int prepare(struct bus *b, struct gon_error *err)
{
    int rc = 0;
    transport_book(b->t)->resyncs += b->out_of_step;
    if (b->out_of_step && !b->rtu)
        rc = bus_reopen(b, err);
    else if (b->out_of_step)
        rc = transport_drain(b->t, CLK_MS(b->quiet_ms), err);
    if (rc < 0)
        return rc;
    b->out_of_step = false;
    clk_sleep_until(b->clk, b->ready_ns, NULL); // a few milliseconds at most
    rc = transport_drain(b->t, 0, err);
    transport_book(b->t)->errors[LINK_STRAY] += rc > 0;
    return rc < 0 ? rc : modbus_master_attach(b->master, err);
}

// Nothing that can be believed came, and something may still come.
static bool is_untrusted(enum master_outcome o)
{
    return o == MASTER_SILENT || o == MASTER_GARBLED || o == MASTER_MISFIT;
}

static void enter(struct link_stats *book, enum master_outcome o, int64_t latency_ns)
{
    book->requests++;
    book->errors[LINK_SILENT] += o == MASTER_SILENT;
    book->errors[LINK_GARBLED] += o == MASTER_GARBLED;
    book->errors[LINK_MISFIT] += o == MASTER_MISFIT;
    book->errors[LINK_REFUSED] += o != MASTER_DONE && o < MASTER_SILENT;
    if (o < MASTER_SILENT)
        link_stats_answer(book, latency_ns);
}

static enum master_outcome carry_out(struct bus *b, const struct request *r)
{
    const int64_t begin_ns = clk_now_ns(b->clk);
    enum master_outcome o = r->registers
                                ? modbus_master_write(b->master, r->unit, r->function, r->address,
                                                      r->count, r->registers)
                                : modbus_master_read(b->master, r->unit, r->function, r->address,
                                                     r->count, r->ret_registers);
    const int64_t end_ns = clk_now_ns(b->clk);
    b->ready_ns = end_ns + b->gap_ns;
    b->out_of_step = is_untrusted(o);
    b->exception = o < MASTER_SILENT ? (int)o : 0;
    enter(transport_book(b->t), o, end_ns - begin_ns);
    return o;
}

static bool is_busy(enum master_outcome o)
{
    return (int)o == MASTER_EXCEPTION_ACKNOWLEDGE || (int)o == MASTER_EXCEPTION_BUSY;
}

// One try. A unit that is busy did not carry it out and is asked again, for a second.
static int attempt(struct bus *b, const struct request *r, enum master_outcome *ret_outcome,
                   struct gon_error *err)
{
    const int64_t give_up_ns = clk_now_ns(b->clk) + BUSY_MOST_NS;
    const struct cancel *cancel = r->registers ? NULL : b->cancel;
    for (int64_t wait_ns = BUSY_FIRST_NS;; wait_ns *= 2) {
        const struct cancel *before = transport_mind(b->t, cancel);
        int rc = prepare(b, err);
        transport_mind(b->t, before);
        if (rc < 0)
            return rc;
        enum master_outcome o = carry_out(b, r);
        if (r->registers && (int)o == MASTER_EXCEPTION_ACKNOWLEDGE)
            o = MASTER_DONE; // accepted, and still at work: the caller looks at its status anyway
        if (!is_busy(o) || clk_now_ns(b->clk) + wait_ns > give_up_ns) {
            *ret_outcome = o;
            return 0;
        }
        if (clk_sleep(b->clk, wait_ns, cancel) < 0)
            return gon_fail(err, GON_E_CANCELED, "%s: stopped while unit %d is busy", bus_link(b),
                            r->unit);
    }
}

static const char *exception_text(int code)
{
    switch (code) {
    case MASTER_EXCEPTION_FUNCTION: return "does not know the function";
    case MASTER_EXCEPTION_ADDRESS: return "has no such register; is it the right kind of unit?";
    case MASTER_EXCEPTION_VALUE: return "does not accept the value";
    case MASTER_EXCEPTION_FAILURE: return "reports a failure";
    case MASTER_EXCEPTION_ACKNOWLEDGE:
    case MASTER_EXCEPTION_BUSY: return "stays busy";
    case 10:
    case 11: return "cannot be reached by the gateway";
    default: return "refuses";
    }
}

static const char *what(int function)
{
    switch (function) {
    case 1:
    case 5:
    case 15: return "coils";
    case 2: return "discrete inputs";
    case 4: return "input registers";
    default: return "registers";
    }
}

static int say(const struct bus *b, const struct request *r, enum master_outcome o, int tries,
               struct gon_error *err)
{
    const char *verb = r->registers ? "writing" : "reading";
    if (o == MASTER_GONE)
        return gon_fail(err, GON_E_GONE, "%s: hung up while %s unit %d", bus_link(b), verb,
                        r->unit);
    if (o < MASTER_SILENT)
        return gon_fail(err, GON_E_DEVICE,
                        "%s: unit %d %s (exception %d; function %d, %d %s at %04Xh)", bus_link(b),
                        r->unit, exception_text((int)o), (int)o, r->function, r->count,
                        what(r->function), (unsigned)r->address);
    return gon_fail(
        err, GON_E_LINK, "%s: unit %d %s (%s %d %s at %04Xh; %d %s, %d ms each)%s", bus_link(b),
        r->unit, o == MASTER_SILENT ? "does not answer" : "answers what cannot be trusted", verb,
        r->count, what(r->function), (unsigned)r->address, tries, tries == 1 ? "try" : "tries",
        b->timeout_ms, r->registers ? "; it may have been carried out" : "");
}

int bus_read_table(struct bus *b, int unit, enum bus_table table, int address, int count, int tries,
                   uint16_t *ret_registers, struct gon_error *err)
{
    static const int function[] = {3, 4, 1, 2};
    assert(count >= 1 && count <= 125 && address >= 0 && address + count <= 0x10000);
    assert(tries >= 1);
    const struct request r = {unit, function[table], address, count,
                              .ret_registers = ret_registers};
    enum master_outcome o = MASTER_SILENT;
    for (int i = 0; i < tries; i++) {
        if (i > 0 && cancel_requested(b->cancel))
            return gon_fail(err, GON_E_CANCELED, "%s: stopped", bus_link(b));
        transport_book(b->t)->retries += i > 0;
        int rc = attempt(b, &r, &o, err);
        if (rc < 0)
            return rc;
        if (o == MASTER_DONE)
            return 0;
        if (!is_untrusted(o))
            break;
    }
    return say(b, &r, o, tries, err);
}

int bus_write_table(struct bus *b, int unit, enum bus_table table, int address, int count,
                    bool single, const uint16_t *registers, struct gon_error *err)
{
    assert(table == BUS_HOLDING || table == BUS_COIL);
    assert(count >= 1 && count <= 123 && address >= 0 && address + count <= 0x10000);
    const int many = table == BUS_COIL ? 15 : 16, one = table == BUS_COIL ? 5 : 6;
    const struct request r = {unit, single && count == 1 ? one : many, address, count,
                              .registers = registers};
    enum master_outcome o;
    int rc = attempt(b, &r, &o, err);
    if (rc < 0)
        return rc;
    return o == MASTER_DONE ? 0 : say(b, &r, o, 1, err);
}

int bus_read(struct bus *b, int unit, int address, int count, uint16_t *ret_registers,
             struct gon_error *err)
{
    return bus_read_table(b, unit, BUS_HOLDING, address, count, READ_TRIES, ret_registers, err);
}

int bus_write(struct bus *b, int unit, int address, int count, const uint16_t *registers,
              struct gon_error *err)
{
    return bus_write_table(b, unit, BUS_HOLDING, address, count, false, registers, err);
}

int bus_exception(const struct bus *b)
{
    return b->exception;
}

int64_t bus_now_ns(const struct bus *b)
{
    return clk_now_ns(b->clk);
}

const char *bus_link(const struct bus *b)
{
    return transport_link(b->t);
}

const struct link_stats *bus_stats(const struct bus *b)
{
    return transport_stats(b->t);
}

void bus_tap(struct bus *b, const struct tap *tap)
{
    transport_tap(b->t, tap);
}
