/* The way back through pairs, as pair_reverse.h draws it. SPDX-License-Identifier: MIT */
#include "pair_reverse.h"

bool ascc_pair_reverse_open(ascc_pair_reverse *pairs, const ascc_reverse *pass)
{
    const ascc_network_run *run = pass->run;
    const ascc_hierarchy *h = run->hierarchy;
    const ascc_plan *plan = run->plan;
    const ascc_term *term = &plan->output.term;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t count = h->set[set].count, d = (size_t)plan->dimension;
    double *force = ascc_arena_take(pass->pass->arena, count, 3 * sizeof *force);
    double *place = ascc_arena_take(pass->pass->arena, count, 3 * sizeof *place);
    uint8_t *fluid = ascc_arena_take(pass->pass->arena, count, 1);
    if (!force || !place || !fluid)
        return false;
    const double steps = pass->pass->time_step / plan->time_step / plan->time_step;
    for (size_t i = 0; i < count; i++) {
        const size_t row = ascc_hierarchy_host_row(h, set, i);
        fluid[i] = row < h->fluid_count;
        for (size_t c = 0; c < 3; c++) {
            const bool there = fluid[i] && c < d;
            const size_t k = row * d + c;
            force[i * 3 + c] =
                there ? pass->pass->correction[k] * plan->output.scale[c] * steps : 0.0;
            place[i * 3 + c] = there ? pass->pass->position[k] : 0.0;
        }
    }
    *pairs = (ascc_pair_reverse){.pass = pass,
                                 .set = set,
                                 .value = ascc_term_source(run, term),
                                 .value_gradient = ascc_reverse_source(pass, term),
                                 .force = force,
                                 .place = plan->output.current_direction ? place : NULL,
                                 .fluid = fluid};
    return true;
}

void ascc_pair_reverse_run(const ascc_pair_reverse *q, ascc_pair_visitor visit)
{
    const ascc_network_run *run = q->pass->run;
    const ascc_rows *rows = ascc_term_list(run, &run->plan->output.term, 0);
    for (size_t i = 0; i < rows->query->count; i++) {
        if (!q->fluid[i])
            continue;
        for (size_t k = rows->start[i]; k < rows->start[i] + rows->count[i]; k++) {
            const size_t j = rows->neighbor[k];
            if (j == i || (j < i && q->fluid[j]))
                continue;
            double r[3], d[3];
            ascc_seen_displacement(run, rows, i, j, r);
            if (!q->place && ascc_dot3(r, r) == 0.0)
                continue; /* coincident: no impulse */
            for (size_t c = 0; c < 3; c++)
                d[c] = q->place ? q->place[j * 3 + c] - q->place[i * 3 + c] : r[c];
            visit(q, i, j, r, d);
        }
    }
}
