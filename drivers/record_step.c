// SPDX-License-Identifier: MIT
#include "drivers/record_step.h"

#include "drivers/profile_use.h"

#include <stdio.h>
#include <string.h>

enum { LINE = 400 };

static bool take_name(const char *text, size_t size, char ret_name[PROFILE_NAME])
{
    while (size > 0 && strchr(" \t", *text))
        text++, size--;
    while (size > 0 && strchr(" \t", text[size - 1]))
        size--;
    if (size == 0 || size >= PROFILE_NAME)
        return false;
    memcpy(ret_name, text, size);
    ret_name[size] = 0;
    return true;
}

static bool can_be_asked(const struct profile *p, const char *name)
{
    const int value = profile_value(p, name), exchange = profile_exchange(p, name);
    return p->protocol == PROFILE_MODBUS ? value >= 0 && profile_is_readable(p, value)
                                         : exchange >= 0 && profile_only_asks(p, exchange);
}

static bool can_be_done(const struct profile *p, const char *name)
{
    return p->protocol == PROFILE_MODBUS ? profile_write(p, name) >= 0
                                         : profile_exchange(p, name) >= 0;
}

static int unknown(const struct profile *p, const char *name, struct gon_error *err)
{
    const bool modbus = p->protocol == PROFILE_MODBUS;
    const int value = profile_value(p, name);
    if (modbus && value >= 0)
        return gon_fail(err, GON_E_INPUT, "%s cannot be read", name);
    return gon_fail(err, GON_E_INPUT, "profile %s has no %s '%s'%s", p->name,
                    modbus ? "value or write" : "exchange", name,
                    value >= 0 ? "; to set a value: NAME=VALUE" : "");
}

// "NAME = VALUE": what sets it.
static int parse_setting(const struct profile *p, const char *line, struct record_step *ret,
                         struct gon_error *err)
{
    char name[PROFILE_NAME];
    const int value = take_name(line, strcspn(line, "="), name) ? profile_value(p, name) : -1;
    if (value < 0)
        return gon_fail(err, GON_E_INPUT, "profile %s has no value '%.*s'", p->name,
                        (int)strcspn(line, "="), line);
    const int by = profile_setter(p, value);
    if (by < 0)
        return gon_fail(err, GON_E_INPUT, "nothing in profile %s sets %s", p->name, name);
    snprintf(ret->does, sizeof ret->does, "%s",
             p->protocol == PROFILE_MODBUS ? p->writes[by].name : p->exchanges[by].name);
    snprintf(ret->with, sizeof ret->with, "%s", line);
    return 0;
}

static int parse_names(const struct profile *p, const char *line, struct record_step *ret,
                       struct gon_error *err)
{
    const char *at = line;
    char name[PROFILE_NAME];
    for (;;) {
        const size_t size = strcspn(at, ",");
        if (!take_name(at, size, name))
            return gon_fail(err, GON_E_INPUT, "'%.80s' is no name", line);
        if (!can_be_asked(p, name))
            break;
        if (ret->asks.count == PROFILE_ASKS)
            return gon_fail(err, GON_E_INPUT, "at most %d names at once", PROFILE_ASKS);
        snprintf(ret->asks.name[ret->asks.count++], PROFILE_NAME, "%s", name);
        if (!at[size])
            return 0;
        at += size + 1;
    }
    if (ret->asks.count > 0 || strchr(line, ',') || !can_be_done(p, name))
        return can_be_done(p, name) ? gon_fail(err, GON_E_INPUT, "%s: does something; alone", name)
                                    : unknown(p, name, err);
    snprintf(ret->does, sizeof ret->does, "%s", name);
    return 0;
}

int record_step_parse(const struct profile *p, const char *line, struct record_step *ret_step,
                      struct gon_error *err)
{
    struct record_step step = {.with = ""};
    const size_t colon = strcspn(line, ":="); // a text in a value may hold a colon
    int rc = 0;
    if (strlen(line) >= LINE)
        return gon_fail(err, GON_E_INPUT, "a line of more than %d characters", LINE - 1);
    if (line[colon] == ':') {
        if (!take_name(line, colon, step.does) || !can_be_done(p, step.does))
            rc = unknown(p, step.does, err);
        snprintf(step.with, sizeof step.with, "%s", line + colon + 1);
    } else {
        rc = line[colon] == '=' ? parse_setting(p, line, &step, err)
                                : parse_names(p, line, &step, err);
    }
    if (rc == 0)
        *ret_step = step;
    return rc;
}

int record_step_with(const struct profile *p, const struct record_step *step,
                     struct profile_data *d, struct golden_params *ret_params,
                     struct gon_error *err)
{
    return p->protocol == PROFILE_MODBUS ? profile_golden_with(p, step->with, d, ret_params, err)
                                         : profile_assign_data(p, step->with, NULL, d, err);
}

int record_step_may(const struct profile *p, const struct record_step *step, struct gon_error *err)
{
    struct profile_data d;
    struct golden_params params = {0};
    profile_data_clear(&d);
    int rc = step->asks.count ? 0 : record_step_with(p, step, &d, &params, err);
    if (rc == 0 && !step->asks.count && profile_switches_on(p, step->does, &d))
        rc = gon_fail(err, GON_E_REFUSED,
                      "%s switches emission on or keeps it on: that is not recorded; switch it on "
                      "at the instrument or with a run, then record what can be asked",
                      step->does);
    return rc;
}
