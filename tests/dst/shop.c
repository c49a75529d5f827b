// SPDX-License-Identifier: MIT
#include "tests/dst/shop.h"

#include "tests/dst/os.h"

#include <stdlib.h>

static void step(void *ctx, int arg);

static void plan_step(struct shop *s)
{
    if (s->due)
        return;
    s->due = true;
    os_at(s->busy_until_ns > os.now_ns ? s->busy_until_ns : os.now_ns, step, s, 0);
}

static void deliver(void *ctx, int arg)
{
    struct shop *s = ctx;
    (void)arg;
    for (struct note *n; (n = note_take(s->answers));)
        note_post(s->to_runner, n);
}

static void step(void *ctx, int arg)
{
    struct shop *s = ctx;
    struct note *n = note_take(s->inbox);
    (void)arg;
    s->due = false;
    if (!n)
        return;
    os.storing = true;
    os.store_ns = os.now_ns;
    storer_step(s->core, n);
    os.storing = false;
    s->busy_until_ns = os.store_ns;
    s->steps++;
    os_at(s->busy_until_ns, deliver, s, 0);
    plan_step(s);
}

void shop_begin(struct shop *s, const struct bench_config *bench, const char *bench_text,
                struct mail *to_runner, struct mail *to_main)
{
    *s = (struct shop){
        .inbox = mail_new(), .answers = mail_new(), .to_runner = to_runner, .to_main = to_main};
    s->links = (struct storer_links){.clk = clk_system(),
                                     .bench = bench,
                                     .bench_text = bench_text,
                                     .directory = ".",
                                     .box = s->inbox,
                                     .to_main = to_main,
                                     .to_runner = s->answers};
    s->core = storer_new(&s->links);
    if (!s->inbox || !s->answers || !s->core)
        abort();
}

void shop_end(struct shop *s)
{
    storer_free(s->core);
    mail_free(s->inbox, note_drop);
    mail_free(s->answers, note_drop);
}

void shop_post(struct shop *s, struct note *n)
{
    note_post(s->inbox, n);
    plan_step(s);
}

struct note *shop_ask(struct shop *s, struct note *n, enum note_kind answer)
{
    shop_post(s, n);
    for (int i = 0; i < 1000; i++) {
        struct note *a = note_wait(s->to_main, 1000);
        if (a && a->letter.kind == (int)answer)
            return a;
        note_free(a);
    }
    return NULL;
}
