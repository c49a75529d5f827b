// SPDX-License-Identifier: MIT
#include "cli/show_profiles.h"

#include "campaign/store.h"
#include "cli/out.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

struct list {
    struct table *table; // NULL: JSON
    json_t *json;
};

struct search {
    const char *name; // or a number
    int64_t id;       // the newest that fits; 0: none
    bool json;
};

static json_t *profile_json(const struct store_kept_profile *p)
{
    json_t *o =
        json_pack("{s:I, s:I}", "id", (json_int_t)p->id, "since_utc_ms", (json_int_t)p->t_utc_ms);
    const char *const texts[][2] = {
        {"name", p->profile.name}, {"role", p->profile.role}, {"text", p->profile.text}};
    for (int i = 0; i < 3; i++) {
        json_t *text = json_string(texts[i][1]); // NULL: not UTF-8
        json_object_set_new(o, texts[i][0], text ? text : json_null());
    }
    return o;
}

static bool add(void *ctx, const struct store_kept_profile *p)
{
    const struct list *list = ctx;
    char since[40];
    if (!list->table) {
        json_array_append_new(list->json, profile_json(p));
        return true;
    }
    out_local(p->t_utc_ms, since, sizeof since);
    table_cell(list->table, "%lld", (long long)p->id);
    table_cell(list->table, "%s", since);
    table_cell(list->table, "%s", p->profile.role);
    table_cell(list->table, "%s", p->profile.name);
    table_cell(list->table, "%zu", strlen(p->profile.text));
    return true;
}

int show_profiles(struct store *s, bool json, struct gon_error *err)
{
    static const char *const head[] = {"id", "since", "role", "name", "bytes"};
    struct list list = {json ? NULL : table_new(5), json_array()};
    for (int i = 0; i < 5 && list.table; i++)
        table_cell(list.table, "%s", head[i]);
    if (list.table) {
        table_right(list.table, 0);
        table_right(list.table, 4);
    }
    int count = store_each_profile(s, add, &list, err);
    json_t *all = json_pack("{s:o}", "profiles", list.json);
    if (json && count >= 0)
        out_json(all);
    if (list.table)
        table_print(list.table, stdout); // those before a damaged one, too
    if (count == 0)
        out_say("%s keeps no profiles; files of version 1 and 2 did not", store_path(s));
    json_decref(all);
    return count < 0 ? count : GON_OK;
}

static bool look(void *ctx, const struct store_kept_profile *p)
{
    struct search *search = ctx;
    char number[24];
    snprintf(number, sizeof number, "%lld", (long long)p->id);
    if (!strcmp(search->name, p->profile.name) || !strcmp(search->name, number))
        search->id = p->id;
    return true;
}

static bool print(void *ctx, const struct store_kept_profile *p)
{
    const struct search *search = ctx;
    if (p->id != search->id)
        return true;
    json_t *o = profile_json(p);
    if (search->json)
        out_json(o);
    else
        fputs(p->profile.text, stdout);
    json_decref(o);
    return false;
}

int show_profile(struct store *s, const char *name, bool json, struct gon_error *err)
{
    struct search search = {.name = name, .json = json};
    int count = store_each_profile(s, look, &search, err);
    if (count < 0)
        return count;
    if (!search.id)
        return gon_fail(err, GON_E_INPUT,
                        "%s: keeps no profile '%s'; see: gonio show FILE --profiles", store_path(s),
                        name);
    count = store_each_profile(s, print, &search, err);
    return count < 0 ? count : GON_OK;
}
