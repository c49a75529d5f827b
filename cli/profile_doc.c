// SPDX-License-Identifier: MIT
#include "cli/profile_check.h"

#include "cli/out.h"
#include "cli/profile_page.h"
#include "cli/verb.h"
#include "drivers/profile.h"

#include <limits.h>
#include <stdlib.h>

static const struct option_row none[] = {VERB_OPTIONS_END};

static const struct verb doc = {"profile doc",
                                "PROFILE",
                                "the reference page of an instrument",
                                "Prints what the profile says of the instrument as a page of "
                                "Markdown.\n",
                                none,
                                NULL};

int profile_doc(int argc, char **argv)
{
    char path[PATH_MAX], nothing;
    const char *name;
    if (verb_take(&doc, argc, argv, &nothing, &name, 1, 1) < 0)
        return EXIT_INPUT;
    struct profile *p = profile_take(name, path, sizeof path);
    if (!p)
        return EXIT_INPUT;
    profile_page_print(stdout, p);
    free(p);
    return out_finish(EXIT_OK);
}
