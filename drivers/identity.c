// SPDX-License-Identifier: MIT
#include "drivers/identity.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

// IEEE 488.2, 10.14: maker, model, serial number, firmware.
static const char *third_field(const char *identity)
{
    const char *model = strchr(identity, ',');
    const char *serial = model ? strchr(model + 1, ',') : NULL;
    return serial && strchr(serial + 1, ',') ? serial + 1 : NULL;
}

void identity_serial(const char *identity, char *ret_serial, size_t size)
{
    const char *said = strstr(identity, "serial ");
    const char *from = said ? said + strlen("serial ") : third_field(identity);
    if (!from) {
        *ret_serial = 0;
        return;
    }
    from += strspn(from, " ");
    if (strncasecmp(from, "s/n", 3) == 0)
        from += 3;
    snprintf(ret_serial, size, "%.*s", (int)strcspn(from, ", "), from);
}

int identity_same(const char *before, const char *now, struct gon_error *err)
{
    char known[64], said[64];
    identity_serial(before, known, sizeof known);
    identity_serial(now, said, sizeof said);
    if (!*known || strcmp(known, said) == 0)
        return 0;
    return gon_fail(err, GON_E_DEVICE,
                    "another device answers here: serial number %s before, %s now; plug the former "
                    "one in again, or restart goniod when the exchange is meant",
                    known, *said ? said : "none");
}
