// SPDX-License-Identifier: MIT
#include "daemon/hub_inside.h"

#include "base/log.h"
#include "campaign/state.h"
#include "daemon/api.h"
#include "daemon/decision.h"
#include "daemon/note.h"
#include "daemon/view.h"

#include <stdio.h>
#include <stdlib.h>

static int submit_known(struct hub *h, int run, const char *by, struct gon_error *err)
{
    if (!hub_is_paused(h, run)) {
        const int rc = queue_submit(h->queue, run, err);
        if (rc >= 0 && !queue_is_held(h->queue)) // before the material that starts it
            arming_start(&h->arming, by);
        return rc;
    }
    int rc = hub_resume(h, by, err);
    return rc < 0 ? rc : GON_OK;
}

static void found(struct hub *h, const struct note *n)
{
    const struct run *run = n->thing ? queue_know(h->queue, n->thing) : NULL;
    if (run)
        http_answer(h->http, n->ticket, 200, view_text(view_run(run, true)));
    else
        http_answer(h->http, n->ticket, 404, api_no_run(n->run));
}

static void known(struct hub *h, struct note *n)
{
    struct gon_error err = n->err;
    uint64_t event_id = hub_event_id(h);
    struct run *run = n->thing ? queue_know(h->queue, n->thing) : NULL;
    int rc = run ? submit_known(h, run->id, n->by, &err) : (int)err.code;
    if (rc == 0) {
        hub_answer_kept(h, n->ticket, 201, hub_submitted(h, run->id, event_id));
    } else {
        if (rc == GON_E_STORE)
            snprintf(h->last_error, sizeof h->last_error, "%s", err.text);
        http_answer(h->http, n->ticket, api_status(rc),
                    n->text ? api_complaints(n->text) : api_error(rc, err.text));
    }
}

static void answer_failed(struct hub *h, uint64_t ticket, const struct gon_error *err)
{
    http_answer(h->http, ticket, api_status(err->code), api_error(err->code, err->text));
}

// One that has the bench or waits is measured again by itself.
static int submit_again(struct hub *h, int run, const char *by, struct gon_error *err)
{
    struct queue_entry entries[MOST_KEPT];
    const size_t count = queue_entries(h->queue, entries, MOST_KEPT);
    for (size_t i = 0; i < count; i++)
        if (entries[i].run->id == run)
            return GON_OK;
    arming_start(&h->arming, by);
    return queue_submit(h->queue, run, err);
}

static void decided(struct hub *h, const struct note *n)
{
    struct gon_error err = n->err;
    const uint64_t event_id = hub_event_id(h);
    const struct run *run = n->thing ? queue_know(h->queue, n->thing) : NULL;
    if (!run || (n->last && submit_again(h, n->run, n->by, &err) < 0)) {
        answer_failed(h, n->ticket, &err);
        return;
    }
    log_say(h->options.log, LOG_NOTICE, "run", "%d: decided about %d readings, see: gonio show %d",
            n->run, n->count, n->run);
    char *text = hub_submitted(h, n->run, event_id);
    json_t *o = json_loads(text, 0, NULL);
    json_object_set_new(o, "readings", json_integer(n->count));
    http_answer(h->http, n->ticket, n->last ? 201 : 200, view_text(o));
    free(text);
}

static void halted(struct hub *h, const struct note *n)
{
    if (n->err.code) {
        snprintf(h->last_error, sizeof h->last_error, "%s", n->err.text);
        char *body = api_error(n->err.code, n->err.text);
        hub_answer_stopped(h, 500, json_loads(body, 0, NULL));
        free(body);
    } else {
        hub_answer_stopped(h, 200, json_pack("{s:n, s:s}", "run", "state", "idle"));
    }
}

static void armed(struct hub *h, const struct note *n)
{
    if (arming_told(&h->arming, n)) {
        char text[400];
        const struct align *a = &h->arming.align;
        arm_describe(&h->arming.seen, text, sizeof text);
        if (n->letter.kind == NOTE_ALIGNED && a->running)
            snprintf(text, sizeof text, "%s aligns at %g W", a->name, a->power_w);
        else if (n->letter.kind == NOTE_ALIGNED)
            snprintf(text, sizeof text, "the alignment of %s ended: %s", a->name, a->end);
        log_say(h->options.log, LOG_NOTICE, "laser", "%s", text);
        hub_publish(h, "laser", view_laser(&h->arming, h->snapshot));
    }
    if (n->ticket && n->err.code)
        http_answer(h->http, n->ticket, api_status(n->err.code),
                    api_error(n->err.code, n->err.text));
    else if (n->ticket)
        http_answer(h->http, n->ticket, 200, view_text(view_laser(&h->arming, h->snapshot)));
}

static void restored(struct hub *h, const struct note *n)
{
    const struct state_queue *earlier = n->thing;
    for (size_t i = 0; earlier && i < earlier->count; i++)
        queue_restore(h->queue, earlier->entries[i].run, earlier->entries[i].held);
    h->restored = true;
    hub_keep_queue(h);
    if (queue_is_held(h->queue))
        log_say(h->options.log, LOG_NOTICE, "queue",
                "held, as goniod was started anew; look: gonio queue, go on: gonio queue release");
}

// Before the list is complete: it could not be read either, and the folder may be another's.
static void unkept(struct hub *h, const struct note *n)
{
    log_say(h->options.log, LOG_ERR, "queue", "%s", n->err.text);
    snprintf(h->last_error, sizeof h->last_error, "%s", n->err.text);
    if (!h->listed && !h->ended_said) {
        h->ended_said = true;
        h->options.ended(h->options.ctx, &n->err);
    }
}

static void take_snapshot(struct hub *h, struct note *n)
{
    free(h->snapshot);
    h->snapshot = note_steal(n);
    if (h->snapshot)
        h->options.looked(h->options.ctx, h->snapshot);
}

static void engine_ended(struct hub *h, const struct note *n)
{
    if (n->run)
        queue_ended(h->queue, n->run, n->state, n->err.code ? &n->err : NULL);
    else if (h->options.ended && !h->ended_said) { // the bench could not even be opened
        h->ended_said = true;
        h->options.ended(h->options.ctx, &n->err);
    }
}

static void take(struct hub *h, struct note *n)
{
    switch ((enum note_kind)n->letter.kind) {
    case NOTE_LISTED:
        if (n->thing)
            queue_know(h->queue, n->thing);
        else
            h->listed = true;
        if (n->err.code)
            log_say(h->options.log, LOG_WARN, "store", "%s", n->err.text);
        break;
    case NOTE_RESTORED: restored(h, n); break;
    case NOTE_UNKEPT: unkept(h, n); break;
    case NOTE_KNOWN: known(h, n); break;
    case NOTE_FOUND: found(h, n); break;
    case NOTE_KEPT: hub_give_back(h, n); break;
    case NOTE_OPENED: queue_opened(h->queue, n->run, note_steal(n), &n->err); break;
    case NOTE_FITTED: hub_fitted(h, n); break;
    case NOTE_CLOSED:
        if (n->last && !n->err.code)
            queue_reopened(h->queue, n->run);
        else
            queue_closed(h->queue, n->run, n->err.code ? &n->err : NULL);
        break;
    case NOTE_DECIDED: decided(h, n); break;
    case NOTE_HAPPENED: hub_happened(h, n); break;
    case NOTE_FIT_ASKED: queue_fit_asked(h->queue, n->run, n->sweep, n->last); break;
    case NOTE_ENDED: engine_ended(h, n); break;
    case NOTE_SNAPSHOT: take_snapshot(h, n); break;
    case NOTE_HALTED: halted(h, n); break;
    case NOTE_ARMED:
    case NOTE_ALIGNED: armed(h, n); break;
    default: break;
    }
}

static void say_when_ready(struct hub *h)
{
    if (!h->ready_said && h->listed && h->snapshot) {
        h->ready_said = true;
        h->options.ready(h->options.ctx, h->snapshot);
    }
}

void hub_say_when_ended(struct hub *h)
{
    if (h->ending && !h->ended_said && queue_idle(h->queue)) {
        h->ended_said = true;
        h->options.ended(h->options.ctx, NULL);
    }
}

void hub_mail_arrived(void *ctx)
{
    struct hub *h = ctx;
    for (struct note *n; (n = note_take(h->box));) {
        take(h, n);
        note_free(n);
    }
    say_when_ready(h);
    hub_say_when_ended(h);
}
