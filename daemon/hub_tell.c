// SPDX-License-Identifier: MIT
#include "daemon/hub_inside.h"

#include "base/log.h"
#include "daemon/messenger.h"
#include "daemon/note.h"
#include "daemon/view.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void hub_publish(struct hub *h, const char *kind, json_t *data)
{
    char *text = view_text(data);
    if (text)
        events_add(h->events, kind, text);
    free(text);
    if (h->http)
        http_wake(h->http);
}

static void answer_stops(struct hub *h, int status, const char *body)
{
    for (int i = 0; i < h->stop_count; i++)
        http_answer(h->http, h->stops[i], status, strdup(body));
    h->stop_count = 0;
}

void hub_answer_stopped(struct hub *h, int status, json_t *o)
{
    json_object_set_new(o, "put_back", h->put_back ? h->put_back : json_array());
    h->put_back = NULL;
    json_object_set_new(o, "laser_off",
                        json_boolean(h->snapshot && instrument_is_dark(h->snapshot)));
    char *body = view_text(o);
    answer_stops(h, status, body);
    free(body);
}

// In the file's history; how a run ended goes there when it is closed.
static void keep_state(struct hub *h, const struct run *run)
{
    if (run->state != RUN_PREPARING && run->state != RUN_RUNNING && run->state != RUN_PAUSED)
        return;
    struct note *n = note_new(NOTE_STATE);
    n->run = run->id;
    n->state = run->state;
    n->text = note_text(run->text);
    note_post(h->store_box, n);
}

static void tell(struct hub *h, const struct run *run)
{
    if (run->state != RUN_PAUSED && run->state != RUN_FAILED && run->state != RUN_DONE)
        return;
    const struct message m = {run->id, run_state_name(run->state), run->name, run->path, run->text};
    messenger_tell(h->messenger, &m);
}

void hub_changed(void *ctx, const struct run *run)
{
    struct hub *h = ctx;
    const bool paused = run->state == RUN_PAUSED;
    const bool bad =
        run->state == RUN_FAILED || (paused && (!run->wanted || run->light != SAFETY_LIGHT_OFF));
    log_say(h->options.log, bad ? LOG_WARN : LOG_NOTICE, "run", "%d %s%s%s", run->id,
            run_state_name(run->state), *run->text ? ": " : "", run->text);
    if (bad)
        snprintf(h->last_error, sizeof h->last_error, "%s", run->text);
    else if (run->state == RUN_RUNNING || run->state == RUN_DONE)
        h->last_error[0] = 0; // it was overcome; the log and the file's events keep it
    hub_publish(h, "state", view_run(run, false));
    tell(h, run);
    if (run == queue_active(h->queue))
        keep_state(h, run);
    if (run == queue_active(h->queue) || queue_idle(h->queue))
        h->held = h->held && run->state == RUN_PAUSED;
    if (queue_idle(h->queue) && h->stop_count)
        hub_answer_stopped(h, 200, view_run(run, false));
}

void hub_happened(struct hub *h, const struct note *n)
{
    static const char *const kinds[] = {"state", "reading", "sweep", "log"};
    const struct run *run = queue_run(h->queue, n->run);
    queue_engine_event(h->queue, n->run, &n->event);
    if (!run || n->event.kind == ENGINE_STATE)
        return;
    json_t *o = view_run(run, false);
    if (n->event.kind == ENGINE_LOG) {
        json_object_set_new(o, "text", json_string(n->text ? n->text : ""));
        log_say(h->options.log, LOG_NOTICE, "run", "%d: %s", n->run, n->text ? n->text : "");
    } else if (n->event.kind == ENGINE_READING) {
        h->readings++;
        json_object_set_new(o, "sweep", json_integer(n->sweep)); // the plan's own names for it
        json_object_set_new(o, "point", json_integer(n->point));
        log_say(h->options.log, LOG_INFO, "reading",
                "run %d, %d of %d, theta_i %g theta_r %g deg, f_r %.5g /sr", n->run, run->done,
                run->total, run->theta_i_deg, run->theta_r_deg, run->f_per_sr);
    } else {
        log_say(h->options.log, LOG_NOTICE, "run", "%d: sweep %d of %d", n->run, run->sweep,
                run->sweeps);
    }
    hub_publish(h, kinds[n->event.kind], o);
}

void hub_fitted(struct hub *h, const struct note *n)
{
    json_t *fit = n->text ? json_loads(n->text, 0, NULL) : NULL;
    bool canceled = !fit && n->err.code == GON_E_CANCELED;
    json_t *o = json_pack("{s:i, s:i, s:b}", "run", n->run, "sweep", n->sweep, "last", n->last);
    if (fit)
        json_object_set_new(o, "fit", fit);
    else
        json_object_set_new(o, "error", json_string(n->err.text));
    if (!fit && !canceled)
        log_say(h->options.log, LOG_WARN, "fit", "run %d after sweep %d: %s", n->run, n->sweep,
                n->err.text);
    hub_publish(h, "fit", o);
    queue_fitted(h->queue, n->run, fit ? n->text : NULL, &n->err);
}
