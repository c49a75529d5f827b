// SPDX-License-Identifier: MIT
#include "base/err.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

int gon_fail(struct gon_error *err, enum gon_code code, const char *fmt, ...)
{
    if (err) {
        va_list ap;
        va_start(ap, fmt);
        vsnprintf(err->text, sizeof err->text, fmt, ap);
        va_end(ap);
        err->code = code;
    }
    return code;
}

int gon_prefix(struct gon_error *err, const char *fmt, ...)
{
    if (!err)
        return GON_E_SYSTEM;

    char rest[sizeof err->text];
    memcpy(rest, err->text, sizeof rest);

    va_list ap;
    va_start(ap, fmt);
    int n = vsnprintf(err->text, sizeof err->text, fmt, ap);
    va_end(ap);
    if (n >= 0 && (size_t)n < sizeof err->text)
        n = snprintf(err->text + n, sizeof err->text - (size_t)n, ": %s", rest);
    return n < 0 ? GON_E_SYSTEM : (int)err->code;
}

const char *gon_code_name(enum gon_code code)
{
    switch (code) {
    case GON_OK: return "ok";
    case GON_E_INPUT: return "input";
    case GON_E_LINK: return "link";
    case GON_E_GONE: return "gone";
    case GON_E_DEVICE: return "device";
    case GON_E_REFUSED: return "refused";
    case GON_E_CANCELED: return "canceled";
    case GON_E_STORE: return "store";
    case GON_E_SYSTEM: return "system";
    }
    return "unknown";
}
