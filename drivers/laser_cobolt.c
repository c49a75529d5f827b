// SPDX-License-Identifier: MIT
// Cobolt 05-01 series: "cmd CR", answered by "text CR LF" (drivers cobolt-lasers/pycobolt and
// microscope's cobolt.py). Settings answer OK; what it does not know "Syntax error...", what it
// refuses "Error...". gom? as the 05 series counts it; the 06 series uses other numbers and is
// refused by identify.
#include "drivers/laser.h"

#include "drivers/message.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define GAP_NS CLK_MS(100)
#define OFF_TRIES 5

enum mode { // gom?
    MODE_OFF,
    MODE_TEMPERATURES,
    MODE_KEY,
    MODE_WARMING,
    MODE_COMPLETED,
    MODE_FAULT,
    MODE_ABORTED,
    MODE_REMOTE,
    MODE_STANDBY,
    MODES
};

enum fault {
    FAULT_NONE,
    FAULT_TEMPERATURE,
    FAULT_INTERLOCK = 3,
    FAULT_POWER = 4,
    FAULTS_MOST = 99
};

struct cobolt {
    struct laser laser; // first
    struct message *m;
    struct message_format format;
    char serial[32];
    double setpoint_w; // as read back last; NAN: not yet
};

static struct cobolt *cobolt_of(struct laser *l)
{
    return (struct cobolt *)l;
}

static const char *link_of(const struct cobolt *c)
{
    return transport_link(message_transport(c->m));
}

// --- questions -----------------------------------------------------------------------------------

struct range {
    int most, value;
};

static int read_int(const char *answer, void *ctx, struct gon_error *err)
{
    struct range *r = ctx;
    double value;
    int rc = message_number(answer, &value, err);
    if (rc < 0)
        return rc;
    if (value != floor(value) || value < 0 || value > r->most)
        return gon_fail(err, GON_E_LINK, "not in 0..%d", r->most);
    r->value = (int)value;
    return 0;
}

static int ask_int(struct cobolt *c, const char *query, int most, int *ret_value,
                   struct gon_error *err)
{
    struct range r = {.most = most};
    int rc = message_ask(c->m, query, read_int, &r, err);
    if (rc == 0)
        *ret_value = r.value;
    return rc;
}

static int read_watts(const char *answer, void *ctx, struct gon_error *err)
{
    double value;
    int rc = message_number(answer, &value, err);
    if (rc < 0)
        return rc;
    if (value < -1 || value > 100)
        return gon_fail(err, GON_E_LINK, "not a power in W");
    *(double *)ctx = value;
    return 0;
}

static int ask_watts(struct cobolt *c, const char *query, double *ret_w, struct gon_error *err)
{
    return message_ask(c->m, query, read_watts, ret_w, err);
}

// A setting. It is sent once; the caller reads back what matters.
static int tell(struct cobolt *c, const char *command, struct gon_error *err)
{
    char answer[120];
    int rc = message_query(c->m, command, answer, sizeof answer, err);
    if (rc < 0 || strcmp(answer, "OK") == 0)
        return rc;
    if (strncasecmp(answer, "syntax error", 12) == 0 || strncasecmp(answer, "error", 5) == 0) {
        message_refused(c->m);
        return gon_fail(err, GON_E_DEVICE, "%s: refuses '%s': %s", link_of(c), command, answer);
    }
    message_out_of_step(c->m, "not an answer to a setting");
    return gon_fail(err, GON_E_LINK, "%s: '%s' was answered '%.80s', not OK", link_of(c), command,
                    answer);
}

static int identify(struct laser *l, char *ret_text, size_t size, struct gon_error *err)
{
    struct cobolt *c = cobolt_of(l);
    char model[64], serial[sizeof c->serial], firmware[32];
    c->format.sync_query = NULL;
    c->serial[0] = 0;
    int rc = message_ask_text(c->m, "glm?", model, sizeof model, err);
    if (rc == 0)
        rc = message_ask_text(c->m, "sn?", serial, sizeof serial, err);
    if (rc == 0)
        rc = message_ask_text(c->m, "gfv?", firmware, sizeof firmware, err);
    if (rc < 0)
        return rc;
    if (strncasecmp(model, "syntax", 6) == 0 || strncasecmp(serial, "syntax", 6) == 0)
        return gon_fail(err, GON_E_DEVICE,
                        "%s: does not say its model ('%s'); is it a Cobolt laser?", link_of(c),
                        model);
    if (strstr(model, "-06-"))
        return gon_fail(err, GON_E_DEVICE, "%s: model %s is of the 06 series; only 05-01 is known",
                        link_of(c), model);
    memcpy(c->serial, serial, sizeof serial);
    if (strlen(serial) > 2)
        c->format.sync_query = "sn?"; // the one answer that fits no other question
    snprintf(ret_text, size, "Cobolt %s, serial %s, firmware %s", model, serial, firmware);
    return 0;
}

// --- status --------------------------------------------------------------------------------------

// An interlock that was opened and is closed again leaves the laser in its fault until the key was
// turned. Fault 3 without that state was latched while nothing was on: it means nothing any more.
static enum laser_state state_of(enum mode mode, bool emission, bool interlock_closed, int fault)
{
    if (!interlock_closed)
        return LASER_INTERLOCK;
    switch (mode) {
    case MODE_TEMPERATURES:
    case MODE_WARMING: return LASER_WARMING;
    case MODE_KEY: return LASER_NEEDS_KEY;
    case MODE_COMPLETED: return emission ? LASER_EMITTING : LASER_OFF;
    case MODE_FAULT: return fault == FAULT_INTERLOCK ? LASER_NEEDS_KEY : LASER_FAULT;
    case MODE_OFF:
    case MODE_ABORTED:
    case MODE_REMOTE:
    case MODE_STANDBY:
    default:
        if (emission)
            return LASER_WARMING;
        return fault && fault != FAULT_INTERLOCK ? LASER_FAULT : LASER_OFF;
    }
}

static int emission(struct laser *l, bool *ret_emission, struct gon_error *err)
{
    int on;
    int rc = ask_int(cobolt_of(l), "l?", 1, &on, err);
    if (rc == 0)
        *ret_emission = on;
    return rc;
}

static int status(struct laser *l, struct laser_status *ret_status, struct gon_error *err)
{
    struct cobolt *c = cobolt_of(l);
    bool on = true;
    int open = 1, mode = MODE_OFF, fault = FAULT_NONE;
    double power_w = (double)NAN;
    int rc = emission(l, &on, err);
    if (rc == 0)
        rc = ask_int(c, "ilk?", 1, &open, err); // 0 is closed
    if (rc == 0)
        rc = ask_int(c, "gom?", MODES - 1, &mode, err);
    if (rc == 0)
        rc = ask_watts(c, "pa?", &power_w, err);
    if (rc == 0)
        rc = ask_int(c, "f?", FAULTS_MOST, &fault, err);
    if (rc == 0 && isnan(c->setpoint_w))
        rc = ask_watts(c, "p?", &c->setpoint_w, err);
    if (rc < 0)
        return rc;
    *ret_status = (struct laser_status){
        .state = state_of((enum mode)mode, on, !open, fault),
        .emission = on,
        .interlock_closed = !open,
        .power_w = power_w,
        .setpoint_w = c->setpoint_w,
        .fault_code = fault,
    };
    return 0;
}

static const char *fault_text(int code)
{
    switch (code) {
    case FAULT_NONE: return "none";
    case FAULT_TEMPERATURE: return "temperature";
    case FAULT_INTERLOCK: return "interlock";
    case FAULT_POWER: return "constant power not reached in time";
    default: return "not in the list of faults";
    }
}

// --- commands ------------------------------------------------------------------------------------

static int set_power(struct laser *l, double power_w, struct gon_error *err)
{
    struct cobolt *c = cobolt_of(l);
    char command[40];
    double now_w;
    if (!(power_w >= 0 && power_w <= 100))
        return gon_fail(err, GON_E_INPUT, "laser power %g W; allowed: 0..100 W", power_w);
    snprintf(command, sizeof command, "p %.4f", power_w);
    c->setpoint_w = (double)NAN;
    int rc = tell(c, command, err);
    if (rc == GON_E_LINK) // the answer was lost: the read-back tells
        rc = 0;
    if (rc == 0)
        rc = ask_watts(c, "p?", &now_w, err);
    if (rc < 0)
        return rc;
    if (fabs(now_w - power_w) > 0.001 * power_w + 0.0001)
        return gon_fail(err, GON_E_DEVICE, "%s: set to %g W, but reads back %g W", link_of(c),
                        power_w, now_w);
    c->setpoint_w = now_w;
    return 0;
}

static int check_may_start(struct laser *l, struct gon_error *err)
{
    struct laser_status s;
    int rc = status(l, &s, err);
    if (rc < 0)
        return rc;
    if (s.state == LASER_INTERLOCK)
        return gon_fail(err, GON_E_REFUSED, "laser stays off: the interlock is open");
    if (s.state == LASER_NEEDS_KEY)
        return gon_fail(err, GON_E_REFUSED, "laser stays off: turn its key switch off and on");
    if (s.state == LASER_FAULT)
        return gon_fail(err, GON_E_DEVICE, "laser stays off: fault %d (%s)", s.fault_code,
                        fault_text(s.fault_code));
    return s.fault_code == FAULT_INTERLOCK ? tell(cobolt_of(l), "cf", err) : 0;
}

// Why the laser did not want to: most often the key, which cannot be seen otherwise.
static int explain_refusal(struct cobolt *c, struct gon_error *err)
{
    struct gon_error why = err ? *err : (struct gon_error){0};
    int key;
    if (strcasestr(why.text, "key") || (ask_int(c, "@cobasks?", 1, &key, NULL) == 0 && !key))
        return gon_fail(err, GON_E_REFUSED, "laser stays off: turn its key switch off and on (%s)",
                        why.text);
    if (strcasestr(why.text, "interlock"))
        return gon_fail(err, GON_E_REFUSED, "laser stays off: the interlock is open (%s)",
                        why.text);
    return GON_E_DEVICE;
}

static int on(struct laser *l, struct gon_error *err)
{
    struct cobolt *c = cobolt_of(l);
    struct gon_error own;
    int autostart = 0;
    err = err ? err : &own;
    int rc = check_may_start(l, err);
    if (rc == 0)
        rc = ask_int(c, "@cobas?", 1, &autostart, err);
    if (rc < 0)
        return rc;
    rc = tell(c, autostart ? "@cob1" : "l1", err);
    return rc == GON_E_DEVICE ? explain_refusal(c, err) : rc;
}

// The start sequence would go on to emission by itself.
static bool is_starting(int mode)
{
    return mode == MODE_TEMPERATURES || mode == MODE_KEY || mode == MODE_WARMING;
}

// One question, no repetition: in off, telling again is worth more than asking again.
static int ask_once(struct cobolt *c, const char *query, int most, int *ret_value,
                    struct gon_error *err)
{
    char answer[120];
    struct range r = {.most = most};
    int rc = message_query(c->m, query, answer, sizeof answer, err);
    if (rc == 0 && read_int(answer, &r, NULL)) {
        rc = message_out_of_step(c->m, "not in the list");
        gon_fail(err, rc, "%s: '%s' was answered '%.80s'", link_of(c), query, answer);
    }
    if (rc == 0)
        *ret_value = r.value;
    return rc;
}

// One round: told after the gap, and what it says then.
static int switch_off(struct cobolt *c, const char *command, bool *ret_off, struct gon_error *err)
{
    int emits = 1, mode = MODE_WARMING;
    int rc = message_send_blind(c->m, command, false, err);
    if (rc == 0)
        rc = ask_once(c, "l?", 1, &emits, err);
    if (rc == 0)
        rc = ask_once(c, "gom?", MODES - 1, &mode, err);
    if (rc == 0)
        *ret_off = !emits && !is_starting(mode);
    return rc;
}

// At once, even into the gap in which the laser ignores commands; then, with the gap kept, until it
// is seen. The leading CR ends what somebody else left half-sent.
static int off_unminding(struct cobolt *c, struct gon_error *err)
{
    static const char *const commands[] = {"\rl0", "\r@cob0"};
    bool is_off = false;
    int rc = message_send_blind(c->m, commands[0], true, err);
    for (int i = 0; i < OFF_TRIES && !is_off && rc != GON_E_GONE; i++)
        rc = switch_off(c, commands[i % 2], &is_off, err);
    if (rc < 0 || is_off)
        return rc;
    return gon_fail(
        err, GON_E_DEVICE,
        "%s: LASER MAY BE ON: told %d times to switch off, it still says that it emits or "
        "starts; use its key or the interlock",
        link_of(c), OFF_TRIES + 1);
}

static int off(struct laser *l, struct gon_error *err)
{
    struct cobolt *c = cobolt_of(l);
    struct transport *t = message_transport(c->m);
    const struct cancel *cancel = transport_mind(t, NULL);
    int rc = off_unminding(c, err);
    transport_mind(t, cancel);
    return rc;
}

// --- life ----------------------------------------------------------------------------------------

static int cobolt_reopen(struct laser *l, struct gon_error *err)
{
    struct cobolt *c = cobolt_of(l);
    c->setpoint_w = (double)NAN;
    return message_reopen(c->m, err);
}

static const struct link_stats *cobolt_stats(const struct laser *l)
{
    return message_stats(((const struct cobolt *)l)->m);
}

static void cobolt_free(struct laser *l)
{
    if (!l)
        return;
    message_free(cobolt_of(l)->m);
    free(l);
}

int laser_cobolt_open(const char *link, struct clk *clk, const struct cancel *cancel,
                      struct laser **ret_laser, struct gon_error *err)
{
    static const struct laser_ops ops = {identify,     status,     emission,      set_power,
                                         on,           off,        cobolt_reopen, fault_text,
                                         cobolt_stats, cobolt_free};
    struct transport *t;
    int rc = transport_open(link, clk, cancel, &t, err);
    if (rc < 0)
        return rc;
    struct cobolt *c = calloc(1, sizeof *c);
    if (!c) {
        transport_close(t);
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    }
    c->laser.ops = &ops;
    c->setpoint_w = (double)NAN;
    c->format = (struct message_format){
        .end_out = "\r",
        .end_in = "\r\n",
        .min_gap_ns = GAP_NS,
        .timeout_ns = CLK_MS(150),
        .quiet_ns = CLK_MS(350),
        .sync_begins = c->serial,
    };
    if (!(c->m = message_new(t, &c->format))) {
        free(c);
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    }
    *ret_laser = &c->laser;
    return 0;
}
