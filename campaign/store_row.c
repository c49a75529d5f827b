// SPDX-License-Identifier: MIT
#include "campaign/store_row.h"

#include "base/crc32c.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static unsigned char *put(unsigned char *p, uint64_t value, int size)
{
    for (int i = 0; i < size; i++)
        *p++ = (unsigned char)(value >> (8 * i));
    return p;
}

// One NaN for all, and one zero: the database keeps neither the bits of a NaN nor the sign of zero.
static unsigned char *put_real(unsigned char *p, double value)
{
    uint64_t bits = 0x7ff8000000000000u;
    value += 0.0;
    if (!isnan(value))
        memcpy(&bits, &value, sizeof bits);
    return put(p, bits, 8);
}

void store_row_bytes(const struct store_reading *r, unsigned char bytes[STORE_ROW_BYTES])
{
    unsigned char *p = bytes;
    p = put(p, (uint32_t)r->sweep, 4);
    p = put(p, (uint32_t)r->point, 4);
    p = put(p, (uint32_t)r->attempt, 4);
    p = put(p, (uint64_t)r->t_utc_ms, 8);
    p = put(p, (uint32_t)r->theta_i_udeg, 4);
    p = put(p, (uint32_t)r->theta_r_udeg, 4);
    p = put_real(p, r->signal_v);
    p = put_real(p, r->signal_sd_v);
    p = put_real(p, r->monitor_v);
    p = put_real(p, r->monitor_sd_v);
    p = put(p, (uint32_t)r->count, 4);
    p = put(p, (uint32_t)r->range, 4);
    put(p, r->flags, 4);
}

uint32_t store_row_crc(const struct store_reading *r)
{
    unsigned char bytes[STORE_ROW_BYTES];
    store_row_bytes(r, bytes);
    return crc32c(0, bytes, sizeof bytes);
}

int store_row_check(const struct store_reading *r, struct gon_error *err)
{
    const bool monitor_ok = isnan(r->monitor_v)
                                ? isnan(r->monitor_sd_v)
                                : isfinite(r->monitor_v) && isfinite(r->monitor_sd_v);
    if (!isfinite(r->signal_v) || !isfinite(r->signal_sd_v) || !monitor_ok)
        return gon_fail(err, GON_E_INPUT,
                        "sweep %d, point %d: signal %g V (sd %g), monitor %g V (sd %g): what is "
                        "not a number is not "
                        "stored as one",
                        r->sweep, r->point, r->signal_v, r->signal_sd_v, r->monitor_v,
                        r->monitor_sd_v);
    if (r->attempt < 1 || r->count < 1 || r->signal_sd_v < 0 || r->monitor_sd_v < 0)
        return gon_fail(err, GON_E_INPUT,
                        "sweep %d, point %d: attempt %d with %d samples, sd %g V and %g V",
                        r->sweep, r->point, r->attempt, r->count, r->signal_sd_v, r->monitor_sd_v);
    return GON_OK;
}

int store_flags_text(unsigned flags, char *text, size_t size)
{
    static const char *const names[] = {"saturated", "under range",  "stale",     "monitor low",
                                        "moved",     "no reference", "unsettled", "discarded"};
    char all[160] = "";
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        size_t used = strlen(all);
        if (flags & (1u << i))
            snprintf(all + used, sizeof all - used, "%s%s", used ? ", " : "", names[i]);
    }
    return snprintf(text, size, "%s", all);
}
