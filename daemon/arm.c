// SPDX-License-Identifier: MIT
#include "daemon/arm.h"

#include "base/clk.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static const char ran_out[] = "it ran out";

static int check(const char *name, const char *reason, double for_s, struct gon_error *err)
{
    if (!*name || strlen(name) >= ARM_NAME)
        return gon_fail(err, GON_E_INPUT,
                        "arming needs a name of at most %d bytes; set GONIO_NAME", ARM_NAME - 1);
    if (reason && strlen(reason) >= ARM_REASON)
        return gon_fail(err, GON_E_INPUT, "the reason has %zu bytes, at most %d fit; shorten it",
                        strlen(reason), ARM_REASON - 1);
    if (!(for_s >= ARM_LEAST_S && for_s <= ARM_MOST_S))
        return gon_fail(err, GON_E_INPUT, "armed for %g s: allowed are %g s to %g days", for_s,
                        ARM_LEAST_S, ARM_MOST_S / 86400.0);
    return 0;
}

int arm_set(struct arm *a, const char *name, const char *reason, double for_s, int64_t now_ns,
            int64_t utc_ms, struct gon_error *err)
{
    int rc = check(name, reason, for_s, err);
    if (rc < 0)
        return rc;
    *a = (struct arm){.live = true,
                      .since_utc_ms = utc_ms,
                      .until_utc_ms = utc_ms + llrint(for_s * 1e3),
                      .expiry_ns = now_ns + CLK_S(for_s),
                      .changes = a->changes + 1};
    snprintf(a->name, sizeof a->name, "%s", name);
    snprintf(a->reason, sizeof a->reason, "%s", reason ? reason : "");
    return 0;
}

int arm_extend(struct arm *a, const char *name, const char *reason, double for_s, int64_t now_ns,
               int64_t utc_ms, struct gon_error *err)
{
    int rc = check(name, reason, for_s, err);
    if (rc < 0 || (arm_is_live(a, now_ns) && a->expiry_ns >= now_ns + CLK_S(for_s)))
        return rc;
    return arm_set(a, name, reason, for_s, now_ns, utc_ms, err);
}

void arm_end(struct arm *a, const char *why)
{
    if (!a->live)
        return;
    a->live = false;
    a->changes++;
    snprintf(a->end, sizeof a->end, "%s", why);
}

void arm_tick(struct arm *a, int64_t now_ns)
{
    if (!arm_is_live(a, now_ns))
        arm_end(a, ran_out);
}

bool arm_is_live(const struct arm *a, int64_t now_ns)
{
    return a && a->live && now_ns < a->expiry_ns;
}

void arm_describe(const struct arm *a, char *text, size_t size)
{
    char until[40];
    const time_t s = (time_t)(a->until_utc_ms / 1000);
    struct tm tm;
    strftime(until, sizeof until, "%Y-%m-%d %H:%M", localtime_r(&s, &tm));
    if (a->live)
        snprintf(text, size, "armed by %s until %s%s%s%s", a->name, until, *a->reason ? " (" : "",
                 a->reason, *a->reason ? ")" : "");
    else if (*a->name)
        snprintf(text, size, "not armed; the arm of %s ended: %s", a->name, a->end);
    else
        snprintf(text, size, "not armed");
}

int arm_check(const struct arm *a, int64_t now_ns, struct gon_error *err)
{
    if (arm_is_live(a, now_ns))
        return 0;
    if (!a || !*a->name)
        return gon_fail(err, GON_E_REFUSED, "not armed; gonio laser arm --for 8h");
    return gon_fail(err, GON_E_REFUSED,
                    "not armed (the arm of %s ended: %s); gonio laser arm --for 8h", a->name,
                    a->live ? ran_out : a->end);
}
