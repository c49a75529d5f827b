// SPDX-License-Identifier: MIT
// How well parameters describe readings that they were not fitted to.
#include "fit/fit.h"

#include "fit/objective.h"
#include "fit/set.h"

#include <math.h>

static int sum(const struct fit_set *set, const struct brdf_params *p, struct fit_control *control,
               struct fit_validation *ret)
{
    double squares = 0, relative = 0, chi2 = set->u ? 0 : (double)NAN;
    for (size_t i = 0; i < set->count; i++) {
        if (i % (CONTROL_SLICE / 8) == 0 && control_ask(control))
            return FIT_E_CANCELED;
        double r = objective_residual(set, p, i), of_model = r / (set->all.f[i] - r);
        squares += r * r;
        relative += of_model * of_model;
        if (set->u)
            chi2 += (r / set->u[i]) * (r / set->u[i]);
    }
    double points = (double)set->count;
    *ret = (struct fit_validation){.points = set->count,
                                   .delta = squares / set->ff,
                                   .chi2_per_point = chi2 / points,
                                   .rms_relative = sqrt(relative / points)};
    return 0;
}

int fit_validate(const struct fit_data *data, const struct fit_options *options,
                 const struct brdf_params *p, struct fit_validation *ret_validation)
{
    struct fit_control control = {.canceled = options->canceled, .ctx = options->cancel_ctx};
    struct fit_set set = {.count = 0};
    int stop = set_compile(data, options, &control, &set);
    if (!stop)
        stop = sum(&set, p, &control, ret_validation);
    set_free(&set);
    return stop;
}
