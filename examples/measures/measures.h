/* Measures of particle fluids: how far a prediction is from the truth, and whether it is physical.
 * SPDX-License-Identifier: MIT
 *
 * A library for programs (evaluation, charts, training logs), not for the run-time. Formulas and
 * units of every measure: docs/measures.md.
 *
 * Said once, true of every call:
 *   arrays     packed double, [count][dimension]; the caller's, read during the call only.
 *   units      metres, seconds, kilograms; in 2D masses and densities are per metre of depth.
 *   nothing is clipped, dropped or repaired: a set with a particle that is not finite has no
 *              distances, and the call returns NOT_FINITE. Count those first, then escapes.
 *   threads    how many threads the call may use, 0 = 1. The result does not depend on it, bit for
 *              bit: threads fill rows, and sums run over rows in order.
 *   errors     besides those named: ARGUMENT (a NULL, a dimension other than 2 and 3, sets that do
 *              not fit each other) and MEMORY. Results of a failed call are NaN or zero.
 */
#ifndef ASCC_MEASURES_H
#define ASCC_MEASURES_H

#include <stddef.h>
#include <stdint.h>

#include <ascc/ascc.h>

/** Particles at one instant. Members a measure does not name may be left zero. */
typedef struct ascc_measure_set {
    int32_t dimension; /* 2 or 3 */
    int32_t reserved;
    size_t count;
    const double *position; /* [count][dimension], m */
    const double *velocity; /* [count][dimension], m/s */
    const double *mass;     /* [count], kg; NULL = all particle_mass */
    double particle_mass;   /* kg */
} ascc_measure_set;

/* ---- First: what no other measure may hide --------------------------------------------------- */

/** Particles of which a position or, if given, a velocity component is not finite. */
size_t ascc_measure_non_finite(const ascc_measure_set *set);

/** What ascc_measure_escapes finds. */
typedef struct ascc_measure_escape {
    size_t count;    /* particles farther outside than half a spacing */
    double farthest; /* from the nearest wall point, of those that escaped, m; 0 if none did */
} ascc_measure_escape;

/**
 * Counts particles outside the boundary.
 *
 * How far outside a particle x is: -sum k n . (x - w) / sum k over wall points w with normals n, with
 * k = (1 - (|x - w| - nearest) / width)^2 where that is positive and width is 3/4 spacing: the signed
 * distance to the nearest wall, smoothed over corners. Escaped: outside by more than half a spacing.
 * So a scene without walls has no escapes, and neither has what flies through an open top within the
 * walls' outline.
 *
 * wall      [wall_count][dimension], the layer of wall points that touches the fluid
 * normal    unit vectors into the fluid
 * errors    NOT_FINITE: only in the walls. A particle that is not finite is not counted here.
 */
ascc_status ascc_measure_escapes(const ascc_measure_set *set, size_t wall_count, const double *wall,
                                 const double *normal, double spacing, int32_t threads,
                                 ascc_measure_escape *escape);

/* ---- Distance between a prediction and the truth, particle by particle ----------------------- */

/** Root of the mean over particles of |a_i - b_i|^2, m. Not divided by the dimension. */
ascc_status ascc_measure_rmse(const ascc_measure_set *a, const ascc_measure_set *b, double *rmse);

/** Mean over particles of |a_i - b_i|, m: err_n1 and err_n2 are this, one and two frames after a true
 * state, averaged over start frames. */
ascc_status ascc_measure_mean_distance(const ascc_measure_set *a, const ascc_measure_set *b,
                                       double *distance);

/* ---- Distance between two sets, whoever is who ----------------------------------------------- */

/**
 * Distance from each particle of `from` to the nearest of `to`, m.
 *
 * distance  [from->count], or NULL
 * mean      of them, or NULL. From truth to prediction and averaged over frames: gt2pred_mean.
 * errors    NOT_FINITE.
 */
ascc_status ascc_measure_nearest(const ascc_measure_set *from, const ascc_measure_set *to,
                                 int32_t threads, double *distance, double *mean);

/** Chamfer distance, both ways: the mean nearest distance from a to b, and from b to a, m. */
ascc_status ascc_measure_chamfer(const ascc_measure_set *a, const ascc_measure_set *b,
                                 int32_t threads, double *a_to_b, double *b_to_a);

/** Most particles ascc_measure_emd_exact takes: its table of distances has count^2 doubles. */
#define ASCC_MEASURE_EMD_LIMIT 6000

/**
 * Earth mover's distance: the least mean distance over all one-to-one assignments, m.
 *
 * assignment  [count], receives the particle of b that each particle of a goes to; or NULL
 * errors      ARGUMENT (counts differ), LIMIT (more than ASCC_MEASURE_EMD_LIMIT), NOT_FINITE.
 * cost        O(count^3) at worst; 1,000 particles take well under a second, 3,000 some seconds.
 */
ascc_status ascc_measure_emd_exact(const ascc_measure_set *a, const ascc_measure_set *b,
                                   int32_t threads, double *emd, uint32_t *assignment);

/** How ascc_measure_sinkhorn works; zero is the default of each. */
typedef struct ascc_measure_sinkhorn_options {
    double epsilon;     /* blur, m; required: half a spacing is what `ascc eval` uses */
    double tolerance;   /* of the marginals' total mass, on which to stop; 0 = 1e-3 */
    int32_t iterations; /* at most, at the last epsilon; 0 = 1000 */
    int32_t threads;
} ascc_measure_sinkhorn_options;

/** What ascc_measure_sinkhorn finds. */
typedef struct ascc_measure_sinkhorn_result {
    double divergence; /* S(a, b), m; debiased: 0 for equal sets, and never below but by rounding */
    double transport;  /* OT(a, b), m: entropic, with the bias */
    double residual;   /* sum of |row sums - 1/n| reached; compare with the tolerance */
    int32_t iterations; /* used at the last epsilon for OT(a, b) */
    int32_t reserved;
} ascc_measure_sinkhorn_result;

/**
 * Debiased entropic transport between uniform measures on two sets of any counts:
 * S(a, b) = OT(a, b) - OT(a, a) / 2 - OT(b, b) / 2, OT with cost |x - y| and entropy epsilon
 * relative to the product measure; in the log domain, epsilon halved from the sets' extent down.
 *
 * errors    NOT_FINITE, LIMIT (not converged: the result is filled and its residual tells how far).
 * cost      O(count_a count_b) an iteration, O(count) memory.
 */
ascc_status ascc_measure_sinkhorn(const ascc_measure_set *a, const ascc_measure_set *b,
                                  const ascc_measure_sinkhorn_options *options,
                                  ascc_measure_sinkhorn_result *result);

/* ---- Speeds ---------------------------------------------------------------------------------- */

/** Bins of speed: [k, k + 1) * 0.1 m/s for k < 100, and one for 10 m/s and above. Fixed. */
#define ASCC_MEASURE_SPEED_BINS 101
#define ASCC_MEASURE_SPEED_BIN 0.1

/** Counts particles by speed. errors: NOT_FINITE. */
ascc_status ascc_measure_speed_histogram(const ascc_measure_set *set,
                                         uint64_t bins[ASCC_MEASURE_SPEED_BINS]);

/** Jensen-Shannon divergence of two histograms, in bits: 0 equal, 1 disjoint. NaN if one is empty. */
double ascc_measure_jsd(const uint64_t *a, const uint64_t *b, size_t bins);

/* ---- Density --------------------------------------------------------------------------------- */

/**
 * Number density by the poly6 window: sum of (1 - r^2/radius^2)^3 over fluid particles nearer than
 * radius, the particle itself included, and over sources.
 *
 * source    [source_count][dimension] further points that count (walls), or NULL. The measures of
 *           this project count the fluid alone; the published evaluation counts fluid and boundary.
 * density   [count]; divide by ascc_measure_rest_density for 1 = rest
 * errors    NOT_FINITE.
 */
ascc_status ascc_measure_density(const ascc_measure_set *set, size_t source_count,
                                 const double *source, double radius, int32_t threads,
                                 double *density);

/** The same sum on an unbounded square or cubic lattice of half the radius. */
double ascc_measure_rest_density(int32_t dimension);

/** Errors of one set of densities against another. */
typedef struct ascc_measure_density_error {
    double maximum;   /* |max p - max t| / rest */
    double mean;      /* |mean p - mean t| / rest */
    double particle;  /* mean |p_i - t_i| / rest; NaN if the counts differ */
    double published; /* |max p - max t| / max t */
} ascc_measure_density_error;

/** Compares densities that were made with the same kind of sources. errors: ARGUMENT (an empty set). */
ascc_status ascc_measure_compare_density(size_t predicted_count, const double *predicted,
                                         size_t true_count, const double *truth, double rest,
                                         ascc_measure_density_error *error);

/* ---- Spacing --------------------------------------------------------------------------------- */

/** What ascc_measure_pairs finds. */
typedef struct ascc_measure_pair_spacing {
    double min_distance;  /* between any two particles, m; infinite with fewer than two */
    uint64_t pair_count;  /* unordered pairs nearer than two spacings */
    uint64_t close_count; /* of those, nearer than half a spacing */
    uint64_t tight_count; /* nearer than a fifth */
    double close_fraction, tight_fraction; /* of pair_count; 0 without pairs */
} ascc_measure_pair_spacing;

/** errors: NOT_FINITE. */
ascc_status ascc_measure_pairs(const ascc_measure_set *set, double spacing, int32_t threads,
                               ascc_measure_pair_spacing *pairs);

/* ---- Energy and momentum --------------------------------------------------------------------- */

/** Sums over a set. Vectors have their last component 0 in 2D, angular ones only the last. */
typedef struct ascc_measure_motion_sums {
    double mass;
    double center[3];               /* of mass, m */
    double momentum[3];             /* sum of m v */
    double momentum_scale;          /* sum of m |v| */
    double angular[3];              /* sum of m x cross v, about the origin */
    double angular_about_center[3]; /* the same about the center of mass */
    double angular_scale;           /* sum of m |x - center| |v| */
    double kinetic;                 /* sum of m |v|^2 / 2, J */
    double potential;               /* - sum of m g . x: 0 at the origin, J */
    double max_speed;
} ascc_measure_motion_sums;

/** gravity: [dimension], m/s^2; NULL = none. errors: NOT_FINITE. */
ascc_status ascc_measure_motion(const ascc_measure_set *set, const double *gravity,
                                ascc_measure_motion_sums *sums);

/** |P - P'| / sum of m |v'|: linear momentum of a prediction against the truth's, 0 if both vanish. */
double ascc_measure_momentum_error(const ascc_measure_motion_sums *predicted,
                                   const ascc_measure_motion_sums *truth);
/** |L - L'| / sum of m |x' - c'| |v'|: angular momentum about the origin, 0 if both vanish. */
double ascc_measure_angular_error(const ascc_measure_motion_sums *predicted,
                                  const ascc_measure_motion_sums *truth);

/** |M(t) - external - M(0)| / (|M(0)| + 1e-10): drift of a quantity that nothing but `external`
 * should change; the paper's momentum error where external is 0. */
double ascc_measure_drift(const double now[3], const double start[3], const double external[3]);

/**
 * What is missing from the balance of momentum over some steps, relative to what was exchanged:
 * |before + external - wall - after| / (|external| + |wall| + |after - before|); 0 if all vanish.
 *
 * external  impulse of gravity and other forces on the fluid, kg m/s
 * wall      impulse that the fluid gave to the walls
 */
double ascc_measure_wall_balance(const double before[3], const double after[3],
                                 const double external[3], const double wall[3]);

/* ---- Subsets --------------------------------------------------------------------------------- */

/** Picks `wanted` rows of `count` evenly: row k is floor((k + 1/2) count / wanted). Same counts, same
 * rows, whatever the positions. index: [wanted], wanted <= count. */
void ascc_measure_subset(size_t count, size_t wanted, size_t *index);

#endif
