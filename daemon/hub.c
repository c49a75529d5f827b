// SPDX-License-Identifier: MIT
#include "daemon/hub_inside.h"

#include "base/cancel.h"
#include "base/clk.h"
#include "campaign/bench.h"
#include "daemon/api.h"
#include "daemon/fitter.h"
#include "daemon/loop.h"
#include "daemon/messenger.h"
#include "daemon/note.h"
#include "daemon/runner.h"
#include "daemon/storer.h"

#include <stdlib.h>

static int start_workers(struct hub *h, struct gon_error *err)
{
    struct storer_links s = {clk_system(),         h->options.bench,    h->options.bench_text,
                             h->options.directory, h->store_box,        h->box,
                             h->run_box,           h->options.profiles, h->options.profiles_count};
    struct fitter_links f = {h->cancel, h->fit_box, h->box, h->store_box};
    struct runner_links r = {h->options.bench, h->options.guard, h->cancel,   h->options.directory,
                             h->run_box,       h->box,           h->store_box};
    int rc = storer_start(&s, &h->storer, err);
    rc = rc < 0 ? rc : fitter_start(&f, &h->fitter, err);
    return rc < 0 ? rc : runner_start(&r, &h->runner, err);
}

static int start_messenger(struct hub *h, struct gon_error *err)
{
    const struct bench_config *bench = h->options.bench;
    if (!bench->notify.argc)
        return GON_OK;
    for (int i = 0; i < bench->notify.argc; i++)
        h->notify[i] = bench->notify.argv[i];
    const struct messenger_command command = {h->notify, bench->notify.limit_s};
    return messenger_new(h->loop, &command, h->options.log, &h->messenger, err);
}

static int build(struct hub *h, int listen_fd, struct gon_error *err)
{
    const struct queue_ports q = hub_queue_ports(h);
    struct http_ports p = {h, api_request};
    // Ids go on rising from one life of the daemon to the next: a thousand a second and it would be
    // late.
    uint64_t first_id = (uint64_t)(clk_utc_ns(clk_system()) / 1000000000) * 1000;
    h->box = mail_new();
    h->store_box = mail_new();
    h->run_box = mail_new();
    h->fit_box = mail_new();
    h->arming.to_runner = h->run_box;
    h->cancel = cancel_new();
    h->events = events_new(MOST_EVENTS, MOST_EVENT_BYTES, first_id);
    h->queue = queue_new(&q);
    if (!h->box || !h->store_box || !h->run_box || !h->fit_box || !h->cancel || !h->events ||
        !h->queue)
        return gon_fail(err, GON_E_SYSTEM, "daemon: out of memory or descriptors");
    int rc = loop_add(h->loop, mail_fd(h->box), hub_mail_arrived, h, err);
    rc = rc < 0 ? rc : start_messenger(h, err);
    rc = rc < 0 ? rc : start_workers(h, err);
    if (rc < 0)
        return rc;
    h->http = http_new(h->loop, listen_fd, h->events, &p, h->options.log, err);
    return h->http ? GON_OK : GON_E_SYSTEM;
}

int hub_new(struct loop *loop, int listen_fd, const struct hub_options *options,
            struct hub **ret_hub, struct gon_error *err)
{
    struct hub *h = calloc(1, sizeof *h);
    if (!h)
        return gon_fail(err, GON_E_SYSTEM, "daemon: out of memory");
    h->options = *options;
    h->loop = loop;
    h->arming.rule = &options->bench->laser;
    h->start_ns = clk_now_ns(clk_system());
    int rc = build(h, listen_fd, err);
    if (rc < 0) {
        hub_free(h);
        return rc;
    }
    note_post(h->store_box, note_new(NOTE_LIST));
    *ret_hub = h;
    return GON_OK;
}

void hub_end(struct hub *h)
{
    if (h->ending)
        return;
    h->ending = true;
    queue_end(h->queue);
    hub_say_when_ended(h);
}

// The instrument thread goes first: it is the one that switches off. The store outlives those who
// write.
bool hub_free(struct hub *h)
{
    if (!h)
        return false;
    if (h->cancel)
        cancel_request(h->cancel);
    if (h->runner)
        note_post(h->run_box, note_new(NOTE_QUIT));
    if (h->fitter)
        note_post(h->fit_box, note_new(NOTE_QUIT));
    bool may_be_on = runner_join(h->runner);
    fitter_join(h->fitter);
    if (h->storer)
        note_post(h->store_box, note_new(NOTE_QUIT));
    storer_join(h->storer);
    http_free(h->http);
    queue_free(h->queue);
    messenger_free(h->messenger);
    events_free(h->events);
    if (h->box)
        loop_remove(h->loop, mail_fd(h->box));
    struct mail *const boxes[] = {h->box, h->store_box, h->run_box, h->fit_box};
    for (int i = 0; i < 4; i++)
        mail_free(boxes[i], note_drop);
    cancel_free(h->cancel);
    free(h->snapshot);
    json_decref(h->put_back);
    free(h);
    return may_be_on;
}
