/* An antisymmetric output with its kernel on a grid (paper Eq. 2). SPDX-License-Identifier: MIT
 *
 * Half of the kernel may be stored: along the halved axis the upper part is what the file holds, the lower
 * part its point mirror, negated. Packed: the whole kernel, [cell][dimension][padded inputs].
 */
#include <math.h>
#include <string.h>

#include "column.h"
#include "cube.h"
#include "model/cost.h"
#include "model/filter.h"
#include "model/initial.h"
#include "pair_reverse.h"
#include "pair_sum.h"

static void read_pairs(ascc_reader *reader, uint32_t object, const ascc_plan *plan, ascc_term *term,
                       const char *name[ASCC_MAX_TENSORS])
{
    static const char *const projections[] = {"none", "radial"};
    static const char *const storages[] = {"half", "full"};
    static const char *const axes[] = {"x", "y", "z"};
    (void)plan;
    ascc_output *output = (ascc_output *)term; /* its first member */
    name[ASCC_TENSOR_WEIGHT] = ascc_reader_text(reader, object, "kernel");
    ascc_filter_read_grid(reader, object, &term->filter);
    output->central = ascc_reader_choice(reader, object, "projection", projections, 2);
    if (ascc_reader_choice(reader, object, "stored", storages, 2) == 0)
        output->half_axis = ascc_reader_choice(reader, object, "half_axis", axes, 3);
}

static void tensors(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    ascc_filter_want_grid(term, plan->output.half_axis, stored, &wanted[ASCC_TENSOR_WEIGHT]);
}

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)layer;
    (void)name;
    ascc_term *term = &entry->term;
    ascc_output *output = &builder->plan.output;
    output->conserves = 1;
    term->filter.skip_self = 1;
    if (output->half_axis >= 0 && term->filter.cells[output->half_axis] % 2)
        return ascc_fail(builder->message, ASCC_ERROR_FORMAT,
                         "output: 'cells' along the half axis are not even");
    return ascc_plan_check_filter(builder, &term->filter, "output");
}

/* Weak; a kernel that is stored whole is its own mirror, negated. */
static void fill_initial(ascc_initial *initial)
{
    const size_t values = (size_t)initial->term->inputs * (size_t)initial->term->outputs;
    const size_t cells = initial->count / values;
    const bool whole = initial->plan->output.half_axis < 0;
    ascc_initial_fill(initial, 0, (whole ? cells / 2 : cells) * values,
                      0.002 * ascc_initial_output(initial->plan));
    for (size_t c = 0; whole && c < cells / 2; c++)
        for (size_t i = 0; i < values; i++)
            initial->value[(cells - 1 - c) * values + i] = -initial->value[c * values + i];
}

static int lists(const ascc_plan *plan, const ascc_term *term, int32_t set,
                 ascc_list_key key[ASCC_MAX_LISTS])
{
    (void)plan;
    key[0] = (ascc_list_key){.query = set,
                             .source = set,
                             .limit = term->filter.neighbor_limit,
                             .radius = term->filter.radius};
    return 1;
}

/* ---- Weights ---- */

static size_t packed_size(const ascc_plan *plan, const ascc_term *term)
{
    return ascc_cell_count(&term->filter) * (size_t)plan->dimension * ascc_padded(term->inputs);
}

/* Stored cells, and which cells of the whole kernel each of them is. */
typedef struct stored_cells {
    int32_t part[3], axis;
    const int32_t *full;
} stored_cells;

static stored_cells cells_of(const ascc_plan *plan, const ascc_term *term)
{
    stored_cells s = {.axis = plan->output.half_axis, .full = term->filter.cells};
    memcpy(s.part, s.full, sizeof s.part);
    if (s.axis >= 0)
        s.part[s.axis] /= 2;
    return s;
}

static size_t stored_count(const stored_cells *s)
{
    return (size_t)s->part[0] * (size_t)s->part[1] * (size_t)s->part[2];
}

static size_t whole_cell(const stored_cells *s, size_t stored)
{
    size_t at[3] = {stored % (size_t)s->part[0], stored / (size_t)s->part[0] % (size_t)s->part[1],
                    stored / (size_t)s->part[0] / (size_t)s->part[1]};
    if (s->axis >= 0)
        at[s->axis] += (size_t)s->part[s->axis];
    return (at[2] * (size_t)s->full[1] + at[1]) * (size_t)s->full[0] + at[0];
}

static void pack(const ascc_plan *plan, const ascc_term *term, float *packed)
{
    const stored_cells s = cells_of(plan, term);
    const size_t a = (size_t)term->inputs, b = (size_t)plan->dimension;
    const size_t a8 = ascc_padded(term->inputs), last = ascc_cell_count(&term->filter) - 1;
    const float *from = term->tensor[ASCC_TENSOR_WEIGHT];
    for (size_t c = 0; c < stored_count(&s); c++) {
        const size_t cell = whole_cell(&s, c);
        for (size_t i = 0; i < a; i++)
            for (size_t o = 0; o < b; o++) {
                const float value = from[(c * a + i) * b + o];
                packed[(cell * b + o) * a8 + i] = value;
                if (s.axis >= 0)
                    packed[((last - cell) * b + o) * a8 + i] = -value;
            }
    }
}

/* A cell and its mirror are one parameter; stored whole, a kernel stays antisymmetric. */
static void unpack(const ascc_plan *plan, const ascc_term *term, const float *packed,
                   float *const gradient[ASCC_MAX_TENSORS])
{
    const stored_cells s = cells_of(plan, term);
    const size_t a = (size_t)term->inputs, b = (size_t)plan->dimension;
    const size_t a8 = ascc_padded(term->inputs), last = ascc_cell_count(&term->filter) - 1;
    const float share = s.axis >= 0 ? 1.0f : 0.5f;
    float *to = gradient[ASCC_TENSOR_WEIGHT];
    for (size_t c = 0; c < stored_count(&s); c++) {
        const size_t cell = whole_cell(&s, c);
        for (size_t i = 0; i < a; i++)
            for (size_t o = 0; o < b; o++)
                to[(c * a + i) * b + o] += share * (packed[(cell * b + o) * a8 + i] -
                                                    packed[((last - cell) * b + o) * a8 + i]);
    }
}

static const char *check_numbers(const ascc_plan *plan, const ascc_term *term)
{
    const size_t values = (size_t)term->inputs * (size_t)plan->dimension;
    const size_t cells = ascc_cell_count(&term->filter);
    const float *kernel = term->tensor[ASCC_TENSOR_WEIGHT];
    for (size_t c = 0; plan->output.half_axis < 0 && c < (cells + 1) / 2; c++)
        for (size_t i = 0; i < values; i++)
            if (kernel[c * values + i] != -kernel[(cells - 1 - c) * values + i])
                return "is not antisymmetric under point mirroring";
    return NULL;
}

/* Each pair is on its own. */
static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    const double corners = plan->dimension == 2 ? 4.0 : 8.0;
    return 0.5 * ascc_cost_neighbors(plan, counts, set, term->filter.radius) * corners *
           term->inputs * plan->dimension;
}

/* Terms that nothing turns become impulses in the kernel table, four numbers each. */
static size_t stride_of(const ascc_plan *plan)
{
    return plan->output.central ? (size_t)plan->dimension : 4;
}

static void scratch(const ascc_plan *plan, const ascc_term *term, ascc_scratch_sizes *sizes)
{
    (void)term;
    sizes->column = stride_of(plan) * sizeof(int64_t);
}

/* ---- Pairs ---- */

/* Fills the batch up to whole vectors, so that no pair is mapped on its own; returns the count. */
static size_t fill_up(ascc_pair_batch *b)
{
    size_t count = b->count;
    for (; count % 8; count++)
        b->neighbor[count] = b->neighbor[0];
    return count;
}

/* Terms projected on the lines between the particles. */
static void make_central(const ascc_pair_sum *sum, size_t i, const ascc_pair_batch *b,
                         ascc_pair_impulses t)
{
    double d[3][ASCC_PAIR_BATCH], square[ASCC_PAIR_BATCH];
    ascc_pair_displacements(sum->rows, NULL, i, b, d, square);
    for (size_t k = 0; k < b->count; k++) {
        const double along = d[0][k] * t[0][k] + d[1][k] * t[1][k] + d[2][k] * t[2][k];
        const double share = along / square[k];
        for (int c = 0; c < 3; c++)
            t[c][k] = share * d[c][k];
    }
}

/* Masses of pairs that do not all have one. */
static void pair_masses(const ascc_pair_sum *sum, size_t i, const ascc_pair_batch *b, double *mass)
{
    mass[0] = sum->mass[i];
    for (size_t k = 0; k < b->count && !sum->uniform; k++)
        mass[k] = ascc_pair_mass(sum->mass[i], sum->mass[b->neighbor[k]]);
}

static void add_terms(ascc_pair_sum *sum, size_t i, const ascc_pair_batch *b, const float *term,
                      const double factor[4])
{
    double mass[ASCC_PAIR_BATCH];
    pair_masses(sum, i, b, mass);
    if (!sum->run->tools->kernels->pair_impulses(term, factor, mass, !sum->uniform,
                                                 ASCC_IMPULSE_LIMIT, b->neighbor, b->count,
                                                 sum->sum + i * 4, sum->sum))
        ascc_pair_sum_note_bad(sum, i);
}

static void add_central_terms(ascc_pair_sum *sum, size_t i, const ascc_pair_batch *b,
                              const float term[][4], const double factor[4])
{
    const int32_t d = sum->run->plan->dimension;
    double impulse[3][ASCC_PAIR_BATCH], mass[ASCC_PAIR_BATCH];
    for (int c = 0; c < 3; c++)
        for (size_t k = 0; k < b->count; k++)
            impulse[c][k] = c < d ? (double)term[k][c] * factor[c] : 0.0;
    make_central(sum, i, b, impulse);
    pair_masses(sum, i, b, mass);
    for (int c = 0; c < 3; c++)
        for (size_t k = 0; k < b->count; k++)
            impulse[c][k] *= sum->uniform ? mass[0] : mass[k];
    ascc_pair_sum_add(sum, i, b, impulse);
}

static void evaluate(ascc_pair_sum *sum, size_t i, ascc_pair_batch *b)
{
    const ascc_network_run *run = sum->run;
    const ascc_plan *plan = run->plan;
    const ascc_term *output = &plan->output.term;
    const ascc_impulse_scale *scale = sum->data;
    const size_t d = (size_t)plan->dimension, a = ascc_padded(output->inputs);
    const float *value = ascc_term_source(run, output);
    float geometry[ASCC_GEOMETRY_ARRAYS * ASCC_PAIR_BATCH], term[ASCC_PAIR_BATCH][4];
    ascc_geometry g;
    ascc_geometry_of(&g, run, sum->rows, &output->filter, i, b->neighbor, fill_up(b), geometry,
                     ASCC_PAIR_BATCH);
    run->tools->kernels->pair_terms(&g.pairs, g.window, b->neighbor, b->count, value + i * a, value,
                                    a, output->filter.cells, ascc_term_packed(run, output), d,
                                    term[0]);
    const double factor[4] = {scale->factor[0], scale->factor[1], d > 2 ? scale->factor[2] : 0.0,
                              0.0};
    if (plan->output.central)
        add_central_terms(sum, i, b, (const float(*)[4])term, factor);
    else
        add_terms(sum, i, b, term[0], factor);
}

static ascc_status impulses(const ascc_network_run *run, const ascc_impulse_scale *scale,
                            const ascc_impulses *to, uint64_t *pair_count)
{
    const ascc_term *term = &run->plan->output.term;
    ascc_pair_sum sum;
    const ascc_status status = ascc_pair_sum_open(
        &sum, run, ascc_network_set(run->network, term->source), scale->mass, stride_of(run->plan));
    if (status != ASCC_OK)
        return status;
    sum.data = scale;
    ascc_pair_sum_run(&sum, ascc_term_list(run, term, 0), evaluate);
    return ascc_pair_sum_give(&sum, ascc_term_source(run, term), ascc_padded(term->inputs), to,
                              pair_count);
}

/* ---- The way back ---- */

/* One pair: terms t = window * sum of trilinear weight * kernel . (f_i + f_j), projected on r if radial. */
static void visit(const ascc_pair_reverse *q, size_t i, size_t j, const double r[3],
                  const double line[3])
{
    (void)line;
    const ascc_reverse *p = q->pass;
    const ascc_plan *plan = p->run->plan;
    const ascc_term *output = &plan->output.term;
    const size_t a = ascc_padded(output->inputs), b = (size_t)plan->dimension;
    const float *weight = ascc_term_packed(p->run, output);
    float *weight_gradient = ascc_reverse_packed(p, output);
    double force[3];
    for (size_t c = 0; c < 3; c++)
        force[c] = q->force[i * 3 + c] - q->force[j * 3 + c];
    double by_term[3] = {force[0], force[1], force[2]};
    const double square = ascc_dot3(r, r),
                 along = square > 0.0 ? ascc_dot3(force, r) / square : 0.0;
    for (int c = 0; plan->output.central && c < 3; c++)
        by_term[c] = along * r[c];
    ascc_place_in_cube at;
    ascc_trilinear t;
    ascc_place_in_cube_of(&output->filter, r, &at);
    ascc_trilinear_at(output->filter.cells, at.at, &t);
    const float *fi = q->value + i * a, *fj = q->value + j * a;
    double term[3] = {0.0, 0.0, 0.0}, by_cube[3] = {0.0, 0.0, 0.0}, by_window = 0.0;
    for (int n = 0; n < t.count; n++)
        for (size_t o = 0; o < b; o++) {
            const float *w = weight + (t.cell[n] * b + o) * a;
            float *g = weight_gradient + (t.cell[n] * b + o) * a;
            const float share = (float)(at.window * t.weight[n] * by_term[o]);
            for (size_t c = 0; c < a; c++)
                g[c] += share * (fi[c] + fj[c]);
            for (size_t c = 0; q->value_gradient && c < a; c++) {
                q->value_gradient[i * a + c] += share * w[c];
                q->value_gradient[j * a + c] += share * w[c];
            }
            if (!p->pass->seen)
                continue;
            double sum = 0.0;
            for (size_t c = 0; c < a; c++)
                sum += (double)w[c] * ((double)fi[c] + (double)fj[c]);
            term[o] += at.window * t.weight[n] * sum;
            by_window += t.weight[n] * sum * by_term[o];
            for (int c = 0; c < 3; c++)
                by_cube[c] += at.window * t.slope[n][c] * sum * by_term[o];
        }
    if (!p->pass->seen)
        return;
    double seen_i[3], seen_j[3];
    const double inside = plan->output.central && square > 0.0 ? ascc_dot3(term, r) / square : 0.0;
    for (int c = 0; c < 3; c++) {
        seen_j[c] = by_window * at.window_slope[c];
        for (int k = 0; k < 3; k++)
            seen_j[c] += by_cube[k] * at.slope[k][c];
        /* force . (r (t . r) / r^2) by r, t held */
        if (plan->output.central)
            seen_j[c] += force[c] * inside + along * term[c] - 2.0 * along * inside * r[c];
        seen_i[c] = -seen_j[c];
    }
    ascc_reverse_place(p, q->set, i, seen_i);
    ascc_reverse_place(p, q->set, j, seen_j);
}

static ascc_status backward(ascc_reverse *pass)
{
    ascc_pair_reverse pairs;
    if (!ascc_pair_reverse_open(&pairs, pass))
        return ASCC_ERROR_MEMORY;
    ascc_pair_reverse_run(&pairs, visit);
    return ASCC_OK;
}

const ascc_operation ascc_op_pairs_grid = {.name = "pairs on a grid",
                                           .type = "antisymmetric",
                                           .read = read_pairs,
                                           .tensors = tensors,
                                           .check = check,
                                           .initial = fill_initial,
                                           .check_numbers = check_numbers,
                                           .lists = lists,
                                           .packed_size = packed_size,
                                           .pack = pack,
                                           .unpack = unpack,
                                           .cost = cost,
                                           .scratch = scratch,
                                           .impulses = impulses,
                                           .backward_output = backward};
