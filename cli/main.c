// SPDX-License-Identifier: MIT
// gonio: finds the verb and runs it.
#include "base/standard.h"
#include "cli/out.h"
#include "cli/verb.h"

#include <curl/curl.h>
#include <signal.h>
#include <stdbool.h>
#include <string.h>

static const struct verb *const verbs[] = {
    &verb_plan,   &verb_run,   &verb_watch,   &verb_status,  &verb_devices,   &verb_stop,
    &verb_laser,  &verb_pause, &verb_resume,  &verb_ack,     &verb_queue,     &verb_control,
    &verb_list,   &verb_show,  &verb_exclude, &verb_restore, &verb_remeasure, &verb_verify,
    &verb_backup, &verb_fit,   &verb_model,   &verb_check,   &verb_doctor,    &verb_profile,
};
enum { VERBS = sizeof verbs / sizeof *verbs };

static void print_verbs(FILE *out)
{
    fprintf(out, "usage: gonio VERB [OPTIONS] [FILE]\n\n");
    for (int i = 0; i < VERBS; i++)
        fprintf(out, "  %-9s %s\n", verbs[i]->name, verbs[i]->summary);
    fprintf(out, "\ngonio help VERB tells more; gonio --version; the daemon: goniod --help\n"
                 "Exit status: 0 done, 1 the instrument or the fit failed, 2 wrong arguments or\n"
                 "file, 3 no daemon, 4 refused, 130 interrupted.\n");
}

static void print_verb(const struct verb *v, FILE *out)
{
    fprintf(out, "usage: gonio %s%s%s%s\n\n", v->name, v->options->name ? " [OPTIONS]" : "",
            *v->operands ? " " : "", v->operands);
    options_fill(out, v->about, 0);
    fputc('\n', out);
    options_describe(out, v->options);
}

static const struct verb *find(const char *name)
{
    const char *names[VERBS + 2] = {"help"};
    for (int i = 0; i < VERBS; i++) {
        if (!strcmp(verbs[i]->name, name))
            return verbs[i];
        names[i + 1] = verbs[i]->name;
    }
    const char *meant = options_suggest(name, names);
    if (meant)
        out_say("no verb '%s'; did you mean '%s'? gonio help lists all", name, meant);
    else
        out_say("no verb '%s'; gonio help lists all", name);
    return NULL;
}

// scdoc takes a star for the beginning of bold.
static void print_escaped(const char *text, FILE *out)
{
    for (; *text; text++)
        fprintf(out, "%s%c", *text == '*' ? "\\" : "", *text);
}

// The list of verbs with their options as scdoc text.
static void print_manual(FILE *out)
{
    for (int i = 0; i < VERBS; i++) {
        const struct verb *v = verbs[i];
        fprintf(out, "## %s %s\n\n", v->name, v->operands);
        print_escaped(v->about, out);
        fputc('\n', out);
        options_manual(out, v->options);
    }
}

static int help(int argc, char **argv)
{
    if (argc == 2 && !strcmp(argv[1], "--man")) {
        print_manual(stdout);
        return EXIT_OK;
    }
    if (argc < 2) {
        print_verbs(stdout);
        return EXIT_OK;
    }
    const struct verb *v = find(argv[1]);
    if (v)
        print_verb(v, stdout);
    return v ? EXIT_OK : EXIT_INPUT;
}

static bool wants_help(int argc, char **argv)
{
    for (int i = 1; i < argc && strcmp(argv[i], "--"); i++)
        if (!strcmp(argv[i], "--help") || !strcmp(argv[i], "-h"))
            return true;
    return false;
}

static int dispatch(int argc, char **argv)
{
    if (argc < 1) {
        print_verbs(stderr);
        return EXIT_INPUT;
    }
    if (!strcmp(argv[0], "--version")) {
        printf("gonio %s\n", GONIO_VERSION);
        return EXIT_OK;
    }
    if (!strcmp(argv[0], "help") || !strcmp(argv[0], "--help") || !strcmp(argv[0], "-h"))
        return help(argc, argv);
    const struct verb *v = find(argv[0]);
    if (v && wants_help(argc, argv)) {
        print_verb(v, stdout);
        return EXIT_OK;
    }
    return v ? v->run(v, argc, argv) : EXIT_INPUT;
}

int verb_take(const struct verb *verb, int argc, char **argv, void *target, const char **operands,
              int least, int most)
{
    struct gon_error err;
    int count = options_take(argc, argv, verb->options, target, operands, most, &err);
    for (int i = 0; i < count; i++)
        if (!*operands[i]) {
            out_say("%s: %s is an empty word; see: gonio help %s", verb->name, verb->operands,
                    verb->name);
            return -1;
        }
    if (count < 0)
        out_say("%s: %s; see: gonio help %s", verb->name, err.text, verb->name);
    else if (count < least)
        out_say("%s: needs %s; see: gonio help %s", verb->name, verb->operands, verb->name);
    return count < least ? -1 : count;
}

int main(int argc, char **argv)
{
    standard_hold();
    signal(SIGPIPE, SIG_IGN);
    curl_global_init(CURL_GLOBAL_DEFAULT);
    int status = out_finish(dispatch(argc - 1, argv + 1));
    curl_global_cleanup();
    return status;
}
