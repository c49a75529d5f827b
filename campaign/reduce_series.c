// SPDX-License-Identifier: MIT
#include "campaign/reduce_series.h"

#include <math.h>
#include <stdlib.h>

int reduce_series_add(struct reduce_series *s, int64_t t_utc_ms, double value,
                      struct gon_error *err)
{
    struct reduce_value *larger = realloc(s->value, (size_t)(s->count + 1) * sizeof *larger);
    if (!larger)
        return gon_fail(err, GON_E_SYSTEM, "reduction: out of memory");
    s->value = larger;
    int at = s->count++;
    for (; at > 0 && s->value[at - 1].t_utc_ms > t_utc_ms; at--)
        s->value[at] = s->value[at - 1];
    s->value[at] = (struct reduce_value){t_utc_ms, value};
    return GON_OK;
}

void reduce_series_clear(struct reduce_series *s)
{
    free(s->value);
    *s = (struct reduce_series){.value = NULL};
}

double reduce_series_mean(const struct reduce_series *s)
{
    double sum = 0;
    for (int i = 0; i < s->count; i++)
        sum += s->value[i].value;
    return s->count ? sum / s->count : (double)NAN;
}

double reduce_series_least(const struct reduce_series *s)
{
    double least = (double)NAN;
    for (int i = 0; i < s->count; i++)
        least = fmin(least, s->value[i].value);
    return least;
}

double reduce_series_at(const struct reduce_series *s, int64_t t_utc_ms)
{
    if (!s->interpolated || !s->count)
        return reduce_series_mean(s);
    int i = 0;
    while (i < s->count && s->value[i].t_utc_ms <= t_utc_ms)
        i++;
    if (i == 0 || i == s->count)
        return s->value[i ? i - 1 : 0].value;
    const struct reduce_value *a = &s->value[i - 1], *b = &s->value[i];
    const double part = (double)(t_utc_ms - a->t_utc_ms) / (double)(b->t_utc_ms - a->t_utc_ms);
    return a->value + part * (b->value - a->value);
}

static double scatter(const struct reduce_series *s)
{
    double sum = 0, sum2 = 0;
    for (int i = 0; i < s->count; i++) {
        sum += s->value[i].value;
        sum2 += s->value[i].value * s->value[i].value;
    }
    return sqrt(fmax(0, sum2 - sum * sum / s->count) / (s->count - 1) / s->count);
}

double reduce_series_u(const struct reduce_series *s)
{
    double largest = 0;
    if (s->count < 2)
        return 0;
    for (int i = 1; i < s->count; i++)
        largest = fmax(largest, fabs(s->value[i].value - s->value[i - 1].value));
    return s->interpolated ? largest / 2 : scatter(s);
}

double reduce_series_samples(const struct reduce_series *s, int samples)
{
    return s->interpolated && s->count ? (double)samples / s->count : samples;
}
