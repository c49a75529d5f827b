// SPDX-License-Identifier: MIT
#include "drivers/inputs.h"

#include "drivers/message.h"
#include "drivers/session.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

struct inputs {
    struct session *s;
    struct clk *clk;
    int64_t read_ns, kept_ns;  // INT64_MIN: never
    int value[PROFILE_VALUES]; // those that a look brings
    int count;
};

static struct inputs *make(struct clk *clk)
{
    struct inputs *in = calloc(1, sizeof *in);
    if (in)
        *in = (struct inputs){.clk = clk, .read_ns = INT64_MIN, .kept_ns = INT64_MIN};
    return in;
}

static void list_values(struct inputs *in)
{
    const struct profile *p = session_profile(in->s);
    bool gives[PROFILE_VALUES] = {false};
    session_gives(p, &p->inputs.status, gives);
    for (int i = 0; i < p->values_count; i++)
        if (gives[i])
            in->value[in->count++] = i;
}

struct inputs *inputs_on_bus(const struct profile *p, struct bus *bus, int unit, struct clk *clk)
{
    struct inputs *in = make(clk);
    if (in && !(in->s = session_on_bus(p, bus, unit))) {
        free(in);
        return NULL;
    }
    if (in)
        list_values(in);
    return in;
}

int inputs_open(const struct profile *p, const char *link, struct clk *clk,
                const struct cancel *cancel, struct inputs **ret_inputs, struct gon_error *err)
{
    struct inputs *in = make(clk);
    if (!in)
        return gon_fail(err, GON_E_SYSTEM, "%s: out of memory", link);
    int rc = session_open(p, link, clk, cancel, &in->s, err);
    if (rc < 0) {
        free(in);
        return rc;
    }
    list_values(in);
    *ret_inputs = in;
    return 0;
}

void inputs_free(struct inputs *in)
{
    if (!in)
        return;
    session_free(in->s);
    free(in);
}

static void forget(struct inputs *in)
{
    for (int i = 0; i < in->count; i++)
        session_data(in->s)->known[in->value[i]] = false;
}

int inputs_reopen(struct inputs *in, struct gon_error *err)
{
    forget(in);
    in->kept_ns = INT64_MIN;
    return session_reopen(in->s, err);
}

// --- looking -------------------------------------------------------------------------------------

int inputs_identify(struct inputs *in, char *ret_text, size_t size, struct gon_error *err)
{
    return session_identify(in->s, ret_text, size, err);
}

int inputs_read(struct inputs *in, struct gon_error *err)
{
    int rc = session_ask(in->s, &session_profile(in->s)->inputs.status, err);
    if (rc < 0)
        forget(in);
    else
        in->read_ns = clk_now_ns(in->clk);
    return rc;
}

int64_t inputs_read_ns(const struct inputs *in)
{
    return in->read_ns;
}

int inputs_count(const struct inputs *in)
{
    return in->count;
}

static struct inputs_value value_at(const struct inputs *in, int value)
{
    const struct profile_value *v = &session_profile(in->s)->values[value];
    return (struct inputs_value){v->name, v->unit, v->help, session_number(in->s, v->name),
                                 session_data(in->s)->known[value]};
}

struct inputs_value inputs_at(const struct inputs *in, int index)
{
    assert(index >= 0 && index < in->count);
    return value_at(in, in->value[index]);
}

bool inputs_find(const struct inputs *in, const char *name, struct inputs_value *ret_value)
{
    for (int i = 0; i < in->count; i++)
        if (strcmp(session_profile(in->s)->values[in->value[i]].name, name) == 0) {
            *ret_value = value_at(in, in->value[i]);
            return true;
        }
    return false;
}

const struct link_stats *inputs_stats(const struct inputs *in)
{
    const struct message *m = session_message(in->s);
    return m ? message_stats(m) : NULL;
}

bool inputs_hold(const struct inputs *in, const char *condition)
{
    return session_holds(in->s, condition);
}

// --- the relay -----------------------------------------------------------------------------------

int inputs_keep(struct inputs *in, struct gon_error *err)
{
    const struct profile_inputs *is = &session_profile(in->s)->inputs;
    const int64_t now_ns = clk_now_ns(in->clk);
    if (!*is->watchdog ||
        (in->kept_ns != INT64_MIN && (double)(now_ns - in->kept_ns) < 0.5e6 * is->watchdog_ms))
        return 0;
    int rc = session_send(in->s, is->watchdog, NULL, err);
    if (rc == 0)
        in->kept_ns = now_ns;
    return rc;
}
