// SPDX-License-Identifier: MIT
// pagmo's CMA-ES behind a C function.
#include "bench/peers/pagmo.h"

#include <exception>
#include <utility>

#include <pagmo/algorithms/cmaes.hpp>
#include <pagmo/population.hpp>
#include <pagmo/problem.hpp>

namespace
{
struct stopped : std::exception {
};

struct surface {
    peers_pagmo_value *value = nullptr;
    void *ctx = nullptr;

    pagmo::vector_double fitness(const pagmo::vector_double &gene) const
    {
        int over = 0;
        double delta = value(ctx, gene.data(), &over);
        if (over)
            throw stopped();
        return {delta};
    }
    std::pair<pagmo::vector_double, pagmo::vector_double> get_bounds() const
    {
        return {{0, 0, 0}, {1, 1, 1}};
    }
    template <typename Archive>
    void serialize(Archive &, unsigned)
    {
    }
};
} // namespace

extern "C" void peers_pagmo_cmaes(peers_pagmo_value *value, void *ctx,
                                  const struct peers_pagmo_options *o)
{
    try {
        surface s;
        s.value = value;
        s.ctx = ctx;
        pagmo::population population(pagmo::problem(s), static_cast<unsigned>(o->population),
                                     o->seed);
        pagmo::cmaes cmaes(static_cast<unsigned>(o->generations), -1, -1, -1, -1, o->sigma0,
                           o->ftol, o->ftol, false, true, o->seed);
        cmaes.evolve(population);
    } catch (const stopped &) {
    }
}
