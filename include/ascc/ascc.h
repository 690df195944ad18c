/*
 * libascc: a learned particle fluid solver that conserves momentum to the bit.
 * SPDX-License-Identifier: MIT
 *
 * A host makes a context, loads a model, fills a particle set, binds model and context into a step,
 * and runs the step: examples/hello.c does all of it in under 100 lines.
 *
 * Said once, true of every call:
 *   results    come back through the last pointers; a struct or array passed in need live only for
 *              the call; outputs of a failed call are NULL or untouched.
 *   structs    of options and results begin with `size`, set by the caller to sizeof(the struct).
 *              Zero in every other member means the default. They only ever grow at the end.
 *   destroy    takes the address of the handle, sets it to NULL and accepts NULL. The order in which
 *              handles are destroyed is free: what others still use lives until they are gone.
 *   errors     every call that can fail returns an ascc_status, and leaves one line that names what
 *              is wrong in the handle it worked on (ascc_context_message and its kin). A call that
 *              only reads a handle (a pointer to const) leaves it in the context, and changes no bit
 *              of the handle: any number of threads may read one at once, and fail at it.
 *   units      lengths are in the host's unit, seconds, kilograms. The model works in metres; the
 *              step's option `length_unit` says how many metres the host's unit is.
 *   floating   every call computes in C's default environment (rounding to nearest, nothing traps,
 *   point      nothing flushed to zero) whatever the calling thread and the job system's threads
 *              have set, and leaves each thread as it was: modes and pending exceptions stay, none
 *              of the library's own are added. A callback may find that default environment in place
 *              of its thread's; one that needs another sets it and puts it back.
 *   the library never prints, aborts, exits or keeps global state.
 */
#ifndef ASCC_ASCC_H
#define ASCC_ASCC_H

#include <stddef.h>
#include <stdint.h>

#include "version.h"

#if defined(_WIN32) && defined(ASCC_BUILD)
#define ASCC_API __declspec(dllexport)
#elif defined(__GNUC__)
#define ASCC_API __attribute__((visibility("default")))
#else
#define ASCC_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/** Result of every call that can fail. Values are frozen: new ones are added, none reused. */
typedef enum ascc_status {
    ASCC_OK = 0,
    ASCC_ERROR_ARGUMENT = -1,   /* a pointer, size or value that the call does not accept */
    ASCC_ERROR_MEMORY = -2,     /* the allocator returned NULL, or a size does not fit size_t */
    ASCC_ERROR_FILE = -3,       /* could not open, read or write */
    ASCC_ERROR_FORMAT = -4,     /* read, but not a model (or snapshot) this version understands */
    ASCC_ERROR_NOT_FINITE = -5, /* a NaN or infinity, in the input or produced by the network */
    ASCC_ERROR_RANGE = -6,      /* a position, momentum or displacement beyond what can be held */
    ASCC_ERROR_MISMATCH = -7,   /* handles that do not go together, such as 2D and 3D */
    ASCC_ERROR_LIMIT = -8,      /* more neighbours than the step's settings allow */
} ascc_status;

/** A short English text for a status, never NULL. Any thread. */
ASCC_API const char *ascc_status_text(ascc_status status);

/** The version of the library that runs: major * 10000 + minor * 100 + patch. Any thread. */
ASCC_API int32_t ascc_version(void);

/* ---- Context: memory, log, workers; shared by everything made from it ------------------------ */

typedef struct ascc_context ascc_context;

/** One piece of work for a host's job system: call it once for each index in [0, count). */
typedef void (*ascc_task)(void *work, int32_t index);

/**
 * Options of ascc_context_create.
 *
 * The callbacks return to the library: no exception, longjmp or end of the thread may pass through
 * it. What the call holds by then would leak, and its handle would be half changed. A C++ allocator
 * that throws is wrapped: catch, return NULL, and the call fails with MEMORY. Callbacks may call the
 * library with other handles; of the one that the call works on they may read the message alone. They
 * are called on several threads at once where the host uses the context on several.
 */
typedef struct ascc_context_options {
    size_t size;          /* sizeof(ascc_context_options) */
    int32_t thread_count; /* threads a step may use at once, the caller's included; 0 = 1 */
    uint32_t cpu_disable; /* ASCC_CPU_* bits not to use although the CPU has them; 0 = use all */

    /* Memory. All three or none; NULL = the C library's. Called only during calls into the library,
     * on the thread that makes the call. Blocks are aligned to 64 bytes; `size` is what was asked. */
    void *(*allocate)(void *user, size_t size, size_t alignment);
    void *(*reallocate)(void *user, void *memory, size_t old_size, size_t size, size_t alignment);
    void (*release)(void *user, void *memory, size_t size);

    /* One line, without newline, for each failed call and each notable event; NULL = silent. */
    void (*log)(void *user, const char *line);

    /* The host's job system. Both or none; NULL = the library's own thread_count - 1 workers.
     * enqueue hands over `count` tasks, runs or schedules them all, in any order and on any threads,
     * and returns a token; finish returns when all tasks of that token have run. */
    void *(*enqueue)(void *user, ascc_task task, void *work, int32_t count);
    void (*finish)(void *user, void *token);

    void *user; /* handed to the callbacks */
} ascc_context_options;

#define ASCC_CPU_AVX2 1u    /* x86-64: AVX2 with FMA */
#define ASCC_CPU_AVX512 2u  /* x86-64: AVX-512 F, BW, DQ, VL */
#define ASCC_CPU_NEON 4u    /* aarch64 */
#define ASCC_CPU_SIMD128 8u /* WebAssembly */

/**
 * Makes a context. Contexts are independent of each other.
 *
 * options   NULL for all defaults; read during the call, not kept.
 * context   receives the handle; the caller's, until ascc_context_destroy.
 * errors    ARGUMENT (thread_count outside [0, 1024], callbacks incomplete, a bit of cpu_disable that
 *           does not exist), MEMORY.
 * threads   a context may be used from several threads at once, if its callbacks may.
 */
ASCC_API ascc_status ascc_context_create(const ascc_context_options *options,
                                         ascc_context **context);
ASCC_API void ascc_context_destroy(ascc_context **context);

/** The ASCC_CPU_* bits this context uses: what the CPU has, less cpu_disable. */
ASCC_API uint32_t ascc_context_cpu(const ascc_context *context);

/**
 * Copies the message of the last failed ascc_*_create, ascc_model_load, ascc_model_save or reading of
 * a particle set of this context, or "", into text[capacity], always terminated. Returns its whole
 * length. Any thread.
 */
ASCC_API size_t ascc_context_message(const ascc_context *context, char *text, size_t capacity);

/* ---- Model: trained weights with the description of their network, read-only ------------------ */

typedef struct ascc_model ascc_model;

/**
 * Loads a model from a safetensors file (docs/file-format.md), by its path in UTF-8. Published networks (metadata format
 * "ascc.weights") are refused: `ascc convert` makes model files of them.
 *
 * context   may be destroyed before the model.
 * model     receives the handle; the caller's, until ascc_model_destroy.
 * errors    ARGUMENT, MEMORY, FILE, FORMAT; the context's message names the tensor or key at fault.
 * cost      reads the file once and keeps its bytes beside the arranged weights.
 * threads   a model never changes: any number of steps on any threads may share it.
 */
ASCC_API ascc_status ascc_model_load(ascc_context *context, const char *path, ascc_model **model);

/**
 * Finds a model file by name: "water3d" is water3d.safetensors in the first of these folders that has it.
 *
 *   - those of the environment's ASCC_MODEL_PATH, with ':' between them (';' on Windows)
 *   - the one the running program lies in, `models` in it, and ../share/ascc/models from there (Linux,
 *     Windows)
 *   - the one that models were installed in with the library
 *
 * A name with a '/', and one of a file in the working directory, is a path and comes back as it is.
 *
 * path      path[capacity], UTF-8, for ascc_model_load; 4096 is always enough. Untouched on error.
 * errors    ARGUMENT (NULL; a path that does not fit), FILE (no folder has it).
 * threads   any; none may change the environment meanwhile.
 */
ASCC_API ascc_status ascc_model_find(ascc_context *context, const char *name, char *path,
                                     size_t capacity);

/** As ascc_model_load, from memory: data[size], copied. */
ASCC_API ascc_status ascc_model_load_memory(ascc_context *context, const void *data, size_t size,
                                            ascc_model **model);

/**
 * Writes the model's file again, byte for byte as it was read.
 *
 * path      a new file, or one to replace, which lends the new one its mode; links are followed. What is
 *           no regular file (a folder, a FIFO, a device) is refused.
 * errors    ARGUMENT, FILE (the context's message has the system's reason and the path).
 * promise   written beside the path, synced, renamed, the folder synced: whatever happens, the file is the
 *           old one or the whole new one. After an error it is the old one and nothing is left beside; the
 *           new one only where the message says that its folder could not be synced.
 */
ASCC_API ascc_status ascc_model_save(const ascc_model *model, const char *path);

/** The model's file as bytes, *size of them; the model's, valid as long as it lives. */
ASCC_API const void *ascc_model_bytes(const ascc_model *model, size_t *size);

/** What ascc_model_get_info tells. Lengths in metres, whatever the host's unit. */
typedef struct ascc_model_info {
    size_t size; /* sizeof(ascc_model_info) */
    int32_t dimension;
    int32_t level_count;                /* branches of the hierarchy; 1 = particles only */
    int32_t layer_count;                /* values the network computes, last layer included */
    int32_t conserves_momentum;         /* 1: antisymmetric last layer */
    int32_t conserves_angular_momentum; /* 1: and pair impulses are central, at current positions */
    int32_t advected;                   /* 1: the network sees x + dt v*, 0: it sees x */
    int32_t neighbor_limit;             /* most neighbours a point keeps; 0 = all */
    int32_t reserved;
    uint64_t parameter_count;
    double time_step;        /* s, as trained */
    double gravity[3];       /* m/s^2, as trained */
    double particle_spacing; /* m, as trained */
    double rest_density;     /* kg/m^3; per metre of depth in 2D */
    double support_radius;   /* m, of the last layer */
    double receptive_radius; /* m: a particle farther away has no influence in one step */
    /* The model's strings, valid as long as it lives, as the file has them: UTF-8 that may hold what a
     * terminal obeys (messages of the library never do). */
    const char *name;
    const char *description;
    double time_step_min, time_step_max; /* s: the range of steps that the weights are good for */
    double multiply_adds; /* of one step for each fluid particle, near the middle of a scene */
    /* Likewise gravity, g dt^2 / h, and the way of a particle, in spacings a step; a step is cut into substeps
     * that stay within (ascc_step_options.substeps). INFINITY = not said. */
    double gravity_min, gravity_max, way_max;
    int32_t tells_distance; /* 1 = the file has what ascc_step_options.measure_distance needs */
    int32_t reserved2;
    double distance_threshold; /* of a mean distance, at which errors double; 0 = not stated */
} ascc_model_info;

ASCC_API ascc_status ascc_model_get_info(const ascc_model *model, ascc_model_info *info);

ASCC_API void ascc_model_destroy(ascc_model **model);

/* ---- Particles: fluid and boundary at one instant -------------------------------------------- */

typedef struct ascc_particles ascc_particles;

/** Which particles a call means. Rows of each kind are numbered from 0, in order of addition. */
typedef enum ascc_kind {
    ASCC_FLUID = 0,
    ASCC_BOUNDARY =
        1, /* solid walls: points with a unit normal into the fluid, a velocity and a body */
} ascc_kind;

/** A property of a particle that can be set and read. `dimension` numbers each, or one. */
typedef enum ascc_field {
    ASCC_POSITION = 0, /* both kinds; length unit */
    /* Both kinds; length unit / s. Of fluid held as momentum: see ascc_particles_options. Of boundary what the
     * host last set, at first 0: during a step of dt the point moves by dt times it. */
    ASCC_VELOCITY = 1,
    ASCC_MASS = 2,   /* fluid; kg, one number. Setting it keeps the velocity */
    ASCC_NORMAL = 3, /* boundary; points into the fluid, length 1 */
    /* Fluid; how much of a particle a ladder's best model computes on lower rungs, from 0 (at first) to 1
     * (docs/budget.md). */
    ASCC_DETAIL = 4,
    /* Fluid; the velocity before the last step; + 1: before the one before that; up to + 7. For models that look back
     * (graph networks). A particle counts as having moved all the time before as it did in the earliest of these that is
     * known, or as it does: setting one sets those before it, too, and setting ASCC_VELOCITY all of them. */
    ASCC_EARLIER_VELOCITY = 16,
} ascc_field;

typedef enum ascc_scalar { ASCC_FLOAT = 0, ASCC_DOUBLE = 1 } ascc_scalar;

/**
 * Where a host's numbers lie: component c of row i is at data + i * stride + c * component_stride.
 * {data} alone means packed float[count][components]. An array of structs gives the struct's size as
 * stride; separate arrays x, y, z give sizeof(float) as stride and their distance as the other.
 * component_stride needs a stride: with 0 the call fails with ARGUMENT, since one row for all is not
 * to be had this way. The structs have no size, so that {data} alone goes on working: they never
 * grow. Another layout would be told by another value of `reserved`, and only 0 is known here.
 */
typedef struct ascc_const_array {
    const void *data;           /* NULL = absent, where the call allows that */
    ptrdiff_t stride;           /* bytes from row to row; 0 = packed */
    ptrdiff_t component_stride; /* bytes from component to component; 0 = packed */
    ascc_scalar scalar;
    int32_t reserved; /* 0, else ARGUMENT */
} ascc_const_array;

typedef struct ascc_array {
    void *data;
    ptrdiff_t stride;
    ptrdiff_t component_stride;
    ascc_scalar scalar;
    int32_t reserved;
} ascc_array;

/** Options of ascc_particles_create. dimension and spacing are required. */
typedef struct ascc_particles_options {
    size_t size;       /* sizeof(ascc_particles_options) */
    int32_t dimension; /* 2 or 3 */
    int32_t reserved;  /* 0, else ARGUMENT */
    double spacing;    /* particle spacing, length unit: what the set's model was trained with */
    /* kg, of a particle added without one; 0 = water in SI units: 1000 kg/m^3 times
     * spacing^dimension, in 2D of a layer one metre deep. Where the length unit is another, or the
     * fluid, give it: rest density times spacing^dimension, the spacing in metres. */
    double mass;
    /* Momentum is held in whole multiples of this, kg length/s; 0 = 2^-28 of the power of two below
     * mass * spacing / s: fine enough for 1e-9 spacings/s, coarse enough for 1e10. */
    double momentum_quantum;
    size_t fluid_capacity, boundary_capacity; /* room to make at once */
} ascc_particles_options;

/**
 * The options of a particle set that suits a model: dimension, spacing, and as mass the rest density times
 * spacing^dimension; the rest zero.
 *
 * length_unit  metres in one unit of the host's length; 0 = 1. Give ascc_step_create the same
 * options      options->size set by the caller; receives the rest
 * errors       ARGUMENT (no model; a length_unit negative or not finite).
 */
ASCC_API ascc_status ascc_model_particles_options(const ascc_model *model, double length_unit,
                                                  ascc_particles_options *options);

/**
 * Makes an empty particle set.
 *
 * errors    ARGUMENT (dimension, spacing, mass or quantum out of range; mass times spacing too large
 *           or too small for a default quantum; NULL), MEMORY.
 * threads   one thread at a time per particle set; reading is not changing.
 */
ASCC_API ascc_status ascc_particles_create(ascc_context *context,
                                           const ascc_particles_options *options,
                                           ascc_particles **particles);
ASCC_API void ascc_particles_destroy(ascc_particles **particles);

/** Makes room so that adding up to these counts allocates nothing. errors: ARGUMENT, MEMORY. */
ASCC_API ascc_status ascc_particles_reserve(ascc_particles *particles, size_t fluid,
                                            size_t boundary);

/**
 * Adds fluid particles at the end.
 *
 * position  [count][dimension], length unit
 * velocity  [count][dimension], length unit / s; data NULL = at rest. NULL pointer likewise.
 * mass      [count], kg, > 0; NULL = the set's
 * ids       uint64_t[count], receives ids that stay with the particles; NULL if not wanted. Ids count
 *           up over both kinds; none is given twice, unless a restore turns the count back.
 * errors    ARGUMENT (mass <= 0), MEMORY, NOT_FINITE, RANGE (also where ids would pass 2^63); on error
 *           nothing was added.
 */
ASCC_API ascc_status ascc_particles_add_fluid(ascc_particles *particles, size_t count,
                                              const ascc_const_array *position,
                                              const ascc_const_array *velocity,
                                              const ascc_const_array *mass, uint64_t *ids);

/**
 * Adds boundary particles of one body at the end.
 *
 * position  [count][dimension], length unit
 * normal    [count][dimension], unit vectors into the fluid
 * body      the host's number for the solid these points belong to, >= 0
 * errors    as ascc_particles_add_fluid.
 */
ASCC_API ascc_status ascc_particles_add_boundary(ascc_particles *particles, size_t count,
                                                 const ascc_const_array *position,
                                                 const ascc_const_array *normal, int32_t body,
                                                 uint64_t *ids);

/**
 * Removes particles of either kind by id; the others keep their order.
 *
 * errors    ARGUMENT: an id unknown, or given twice; then nothing was removed. MEMORY.
 * cost      O(particles + count log particles).
 */
ASCC_API ascc_status ascc_particles_remove(ascc_particles *particles, size_t count,
                                           const uint64_t *ids);

/** Drops all particles of a kind; memory stays. errors: ARGUMENT. */
ASCC_API ascc_status ascc_particles_clear(ascc_particles *particles, ascc_kind kind);

/**
 * Makes the fluid `count` particles: drops the last rows, or adds rows at the origin, at rest and
 * with the set's mass, whose positions the caller sets next. errors: ARGUMENT, MEMORY, RANGE (ids).
 */
ASCC_API ascc_status ascc_particles_resize_fluid(ascc_particles *particles, size_t count);

ASCC_API size_t ascc_particles_count(const ascc_particles *particles, ascc_kind kind);
ASCC_API size_t ascc_particles_capacity(const ascc_particles *particles, ascc_kind kind);
ASCC_API int32_t ascc_particles_dimension(const ascc_particles *particles);

/**
 * Sets a field of rows [first, first + count).
 *
 * errors    ARGUMENT (rows beyond the end, a field the kind does not have, mass <= 0), NOT_FINITE,
 *           RANGE; on error nothing was set.
 */
ASCC_API ascc_status ascc_particles_set(ascc_particles *particles, ascc_kind kind, ascc_field field,
                                        size_t first, size_t count, const ascc_const_array *values);

/** Reads a field of rows [first, first + count) into the host's array. errors: ARGUMENT. */
ASCC_API ascc_status ascc_particles_get(const ascc_particles *particles, ascc_kind kind,
                                        ascc_field field, size_t first, size_t count,
                                        const ascc_array *values);

/** Ids of rows [first, first + count), uint64_t[count]. errors: ARGUMENT. */
ASCC_API ascc_status ascc_particles_get_ids(const ascc_particles *particles, ascc_kind kind,
                                            size_t first, size_t count, uint64_t *ids);

/** Bodies of boundary rows [first, first + count), int32_t[count]. errors: ARGUMENT. */
ASCC_API ascc_status ascc_particles_get_bodies(const ascc_particles *particles, size_t first,
                                               size_t count, int32_t *bodies);

/** Where a particle is now. errors: ARGUMENT: no particle has this id. cost: O(log particles). */
ASCC_API ascc_status ascc_particles_find(const ascc_particles *particles, uint64_t id,
                                         ascc_kind *kind, size_t *row);

/** What one unit of the integers below is worth, kg length/s; a power of two unless given. */
ASCC_API double ascc_particles_momentum_quantum(const ascc_particles *particles);

/**
 * Momentum of fluid rows [first, first + count) in quanta, int64_t[count][dimension]: the state
 * itself, of which velocities are readings. errors: ARGUMENT.
 */
ASCC_API ascc_status ascc_particles_get_momentum(const ascc_particles *particles, size_t first,
                                                 size_t count, int64_t *momentum);

/**
 * Total momentum of the fluid in quanta, exact; total[2] is 0 in 2D (docs/method.md, "Momentum
 * to the bit": without gravity and walls it never changes). errors: ARGUMENT, RANGE (the sum does not fit).
 */
ASCC_API ascc_status ascc_particles_total_momentum(const ascc_particles *particles,
                                                   int64_t total[3]);

/**
 * What the last ascc_step_run gave to a boundary body over all of its steps: equal and opposite to what the
 * body gave the fluid.
 *
 * body      as given when its points were added; -1 = all bodies together
 * point     about which the torque is meant, length unit; NULL = the origin
 * impulse   receives quanta, exact; [2] is 0 in 2D. NULL if not wanted.
 * torque    receives kg length^2/s, angular impulse; in 2D only [2] is used. NULL if not wanted.
 * errors    ARGUMENT, RANGE. cost: O(boundary particles). All zero before the first run.
 */
ASCC_API ascc_status ascc_particles_body_impulse(const ascc_particles *particles, int32_t body,
                                                 const double point[3], int64_t impulse[3],
                                                 double torque[3]);

/**
 * Which fluid sleeps, after a step with a sleep_speed (docs/sleeping.md): uint8_t[count], 1 for rows of
 * [first, first + count) that do. errors: ARGUMENT.
 */
ASCC_API ascc_status ascc_particles_get_asleep(const ascc_particles *particles, size_t first,
                                               size_t count, uint8_t *asleep);

/** Wakes all fluid. What changes rows or walls (add, remove, set, clear) wakes the fluid near them by itself. */
ASCC_API ascc_status ascc_particles_wake(ascc_particles *particles);

/** Bytes ascc_particles_snapshot needs. */
ASCC_API size_t ascc_particles_snapshot_size(const ascc_particles *particles);

/**
 * Writes the whole state into memory[capacity]: same bytes for same state, on any machine.
 * errors: ARGUMENT (capacity too small).
 */
ASCC_API ascc_status ascc_particles_snapshot(const ascc_particles *particles, void *memory,
                                             size_t capacity);

/**
 * Makes the set what it was when the snapshot was taken; a run goes on from there bit for bit.
 * errors: ARGUMENT, FORMAT (not a snapshot, damaged, or of what no set can be; the message tells field
 * and row), MISMATCH (other dimension), MEMORY; on error the set is unchanged.
 */
ASCC_API ascc_status ascc_particles_restore(ascc_particles *particles, const void *memory,
                                            size_t size);

/**
 * A hash of all positions, momenta, masses, normals, velocities of walls, numbers of bodies, and of
 * how bodies move. It does not depend on the order of rows or on ids: equal scenes added in another order have equal hashes. cost: O(particles).
 */
ASCC_API uint64_t ascc_particles_hash(const ascc_particles *particles);

/**
 * The message of the last failed call that changes this set, or measures it, or "". The set's, until
 * the next such call. Calls that only read the set leave theirs in its context: ascc_context_message.
 */
ASCC_API const char *ascc_particles_message(const ascc_particles *particles);

/** What ascc_particles_measure finds. Sums run over the fluid in the host's units. */
typedef struct ascc_measures {
    size_t size; /* sizeof(ascc_measures) */
    double mass;
    double center[3];           /* of mass */
    double momentum[3];         /* kg length/s: a reading; ascc_particles_total_momentum is exact */
    double angular_momentum[3]; /* about the origin; in 2D only [2] */
    double angular_scale;       /* sum of m |x - center| |v|: what an angular error compares with */
    double kinetic_energy;
    double max_speed;
    /* Number density of the fluid by the poly6 kernel with support 2 spacings, relative to an
     * unbounded square or cubic lattice of that spacing: 1 = rest. Walls are not counted, so it falls
     * towards walls and surfaces; its maximum tells compression. */
    double max_density, mean_density;
    double min_distance;  /* between any two fluid particles; 0 with fewer than two */
    uint64_t close_count; /* fluid particles with another nearer than half a spacing */
} ascc_measures;

/**
 * Measures the set (docs/measures.md). errors: ARGUMENT, MEMORY, RANGE; on error measures are
 * untouched. cost: one neighbour search. threads: one at a time, since it leaves its message in the set.
 */
ASCC_API ascc_status ascc_particles_measure(ascc_particles *particles, ascc_measures *measures);

/* ---- Bodies: solids that have a frame of their own and move as a whole ------------------------ */

/** What a body is made of. Its frame's origin is its middle, its axes are the shape's. */
typedef enum ascc_shape_kind {
    ASCC_SHAPE_POINTS = 0, /* points with normals, as given */
    ASCC_SHAPE_PLANE = 1,  /* |x| <= half[0], |z| <= half[2] at y = 0, seen from +y; in 2D a line */
    ASCC_SHAPE_BOX = 2,    /* |x| <= half[0] and so on */
    ASCC_SHAPE_SPHERE = 3, /* of `radius`; in 2D a circle */
    ASCC_SHAPE_CAPSULE =
        4, /* around the y axis: straight for |y| <= half[1], then half spheres of `radius` */
    ASCC_SHAPE_CYLINDER = 5, /* around the y axis, |y| <= half[1]; in 2D a rectangle */
    ASCC_SHAPE_MESH =
        6, /* triangles, counterclockwise seen from outside; in 2D lines, outside on the right */
} ascc_shape_kind;

/** Where the water is. */
typedef enum ascc_water {
    ASCC_WATER_OUTSIDE = 0, /* around a solid */
    ASCC_WATER_INSIDE = 1,  /* in a container. Of a plane: at -y; of points: as their normals say */
    ASCC_WATER_BOTH = 2,    /* on both sides of a thin sheet: two layers of points, back to back */
} ascc_water;

/** A surface that becomes boundary points. Lengths in the length unit; zero in every other member is the default. */
typedef struct ascc_shape {
    size_t size; /* sizeof(ascc_shape) */
    ascc_shape_kind kind;
    ascc_water water;
    double half[3]; /* half extents, > 0 where the kind has them */
    double radius;  /* > 0 where the kind has one */
    double pitch;   /* from point to point at most; 0 = 0.64 particle spacings (docs/walls.md) */
    /* How far behind the surface points lie, seen from the water. 0 = for boxes, spheres, capsules and cylinders
     * with water outside a particle spacing in 2D and 0.6 in 3D (at most half of the least extent), so that they
     * displace as much as they should (docs/bodies.md); on the surface for all else. */
    double inset;
    uint32_t
        open; /* box: bit 2 c = without the face at -half[c], bit 2 c + 1 = without that at +half[c] */
    int32_t reserved; /* 0, else ARGUMENT */
    /* POINTS: [count][dimension] each. MESH: position alone, the corners. */
    size_t count;
    const ascc_const_array *position, *normal;
    size_t face_count; /* MESH */
    const int32_t
        *faces; /* [face_count][dimension], rows of position. Faces without area give no points */
} ascc_shape;

/** Where a body is and how it moves. In 2D only the first two of position and velocity, angle and spin[2]. */
typedef struct ascc_pose {
    size_t size;        /* sizeof(ascc_pose) */
    double position[3]; /* of the frame's origin */
    double rotation
        [4]; /* 3D: unit quaternion x, y, z, w from the frame's axes to the world's; all zero = none */
    double angle;       /* 2D: counterclockwise, radians */
    double velocity[3]; /* of the origin, length unit / s */
    double spin[3];     /* in the world's axes, rad/s */
    double
        jump; /* how far ascc_body_move may put a point from where it is; 0 = a particle spacing, INFINITY =
                  * anywhere. Only what moves with its velocity pushes fluid out of its way: a jump leaves it behind */
} ascc_pose;

/**
 * Adds a body at the end of the boundary.
 *
 * shape     read during the call
 * pose      where its frame is, and how it moves; NULL = the world's frame, at rest
 * body      receives its number: above all that the set has had, also those of ascc_particles_add_boundary
 * errors    ARGUMENT (a member out of range; a rotation whose length is not 1; nothing to make points of),
 *           NOT_FINITE, RANGE (2^26 points and more; a point or its velocity beyond 2^40 spacings; no number
 *           left), MEMORY; the message names the member; on error nothing was added.
 * cost      O(points).
 */
ASCC_API ascc_status ascc_body_add(ascc_particles *particles, const ascc_shape *shape,
                                   const ascc_pose *pose, int32_t *body);

/**
 * Says where a body is when the next step begins, and how it moves from then on. During steps it goes on with this
 * velocity and spin, exactly: substeps and runs of many steps included. A host with a dynamics of its own calls it
 * before each run of one step; where the pose is what the body had come to, only the motion changes.
 *
 * errors    ARGUMENT (no such body; a rotation whose length is not 1; what the dimension does not have), NOT_FINITE,
 *           RANGE (a point would jump farther than `jump`, or beyond 2^40 spacings, or as fast a second; an angle
 *           or spin beyond 10^6); on error nothing has changed.
 * cost      O(points of the body).
 */
ASCC_API ascc_status ascc_body_move(ascc_particles *particles, int32_t body, const ascc_pose *pose);

/** What ascc_body_get tells. */
typedef struct ascc_body_info {
    size_t size;         /* sizeof(ascc_body_info) */
    size_t first, count; /* boundary rows [first, first + count) are its points */
    double position[3], rotation[4], angle, velocity[3], spin[3]; /* as in ascc_pose */
} ascc_body_info;

/** Where a body is now. errors: ARGUMENT: no body has this number and a frame. cost: O(log points). */
ASCC_API ascc_status ascc_body_get(const ascc_particles *particles, int32_t body,
                                   ascc_body_info *info);

/**
 * Removes a body and its points. Points of ascc_particles_add_boundary are no body in this sense: they are removed by
 * id. errors: ARGUMENT (no such body), MEMORY; on error nothing was removed. cost: O(boundary).
 */
ASCC_API ascc_status ascc_body_remove(ascc_particles *particles, int32_t body);

/**
 * The numbers of all bodies, ascending, into bodies[capacity], as many as fit. Returns how many there are. Bodies
 * whose points were all removed by id are among them; ascc_particles_clear of the boundary drops them all.
 */
ASCC_API size_t ascc_bodies_list(const ascc_particles *particles, size_t capacity, int32_t *bodies);

/**
 * What the last ascc_step_run gave to bodies over all of its steps, in one pass.
 *
 * bodies    int32_t[count], none twice
 * impulse   int64_t[count][3] receives quanta, exact; [2] is 0 in 2D. NULL if not wanted.
 * torque    double[count][3] receives kg length^2/s, angular impulse about each body's origin, where it was at each
 *           step; in 2D only [2] is used. NULL if not wanted.
 * errors    ARGUMENT (no such body), RANGE. cost: O(points of these bodies). All zero before the first run.
 */
ASCC_API ascc_status ascc_bodies_impulse(const ascc_particles *particles, size_t count,
                                         const int32_t *bodies, int64_t (*impulse)[3],
                                         double (*torque)[3]);

/* ---- Taps and drains: fluid that comes and goes ------------------------------------------------ */

/**
 * Where fluid comes in. The host's own, kept from call to call: `owed` and `emitted` are what a tap remembers (copy
 * them with the scene), all the rest may be changed at any time. Zero in a member is its default.
 */
typedef struct ascc_tap {
    size_t size;        /* sizeof(ascc_tap) */
    double position[3]; /* of the middle of its mouth, length unit */
    double radius;      /* of the mouth, a disc (in 2D a line) across the velocity; 0 = a box */
    double half[3];     /* half extents of the box, along the world's axes */
    double velocity[3]; /* of what comes out, length unit / s; of a disc not 0 */
    double rate;        /* particles / s, at most; 0 = as many as there is room for */
    double pitch;       /* from place to place in the mouth; 0 = a particle spacing */
    double
        clearance; /* nothing comes out nearer to fluid, nor nearer than half of it to walls; 0 = 0.9 spacings */
    double mass; /* kg, of a particle; 0 = the set's */
    double owed; /* particles that the rate has allowed and no room was for, at most one a place */
    uint64_t emitted; /* in all */
} ascc_tap;

/**
 * Lets out what is due after some seconds, as far as there is room: call it before each run with what that run takes.
 * The mouth is full of places a pitch apart; each gives a particle once the fluid before it is far enough away.
 *
 * ids       uint64_t[capacity], receives the ids of new particles; NULL if not wanted (capacity is not read then).
 *           No more than capacity come out; what is owed comes later.
 * count     receives how many came out
 * errors    ARGUMENT, NOT_FINITE, RANGE (over 2^20 places; as ascc_particles_add_fluid), MEMORY; the message names the
 *           member; on error nothing came out and the tap is as it was.
 * cost      O(fluid + boundary + places times particles near the mouth).
 */
ASCC_API ascc_status ascc_tap_run(ascc_particles *particles, ascc_tap *tap, double seconds,
                                  size_t capacity, uint64_t *ids, size_t *count);

/** Where a drain takes fluid. */
typedef enum ascc_drain_kind {
    ASCC_DRAIN_ALL = 0,        /* everywhere: with `before`, by age */
    ASCC_DRAIN_BOX = 1,        /* within `half` of `position` along each axis */
    ASCC_DRAIN_SPHERE = 2,     /* within `radius` of `position` */
    ASCC_DRAIN_HALF_SPACE = 3, /* on the side of `position` that `normal` points to */
} ascc_drain_kind;

typedef struct ascc_drain {
    size_t size; /* sizeof(ascc_drain) */
    ascc_drain_kind kind;
    int32_t outside; /* 1: outside of the shape in place of inside: what has left the scene */
    double position[3], half[3], radius, normal[3]; /* length unit; a normal of any length but 0 */
    uint64_t before; /* only particles with an id below, which are older; 0 = of any age */
} ascc_drain;

/**
 * Removes the fluid that a drain takes; the others keep their order.
 *
 * ids       uint64_t[capacity], receives the ids of those removed, ascending; the oldest `capacity` are removed and the
 *           rest at the next call. NULL: all are removed, and capacity is not read.
 * count     receives how many were removed; NULL if not wanted
 * errors    ARGUMENT, NOT_FINITE, MEMORY; the message names the member; on error nothing was removed.
 * cost      O(fluid).
 */
ASCC_API ascc_status ascc_drain_run(ascc_particles *particles, const ascc_drain *drain,
                                    size_t capacity, uint64_t *ids, size_t *count);

/* ---- Step: a model bound to the scratch memory it needs to advance particles ------------------ */

typedef struct ascc_step ascc_step;

/** Options of ascc_step_create. */
typedef struct ascc_step_options {
    size_t size; /* sizeof(ascc_step_options) */
    double
        time_step; /* s; 0 = the model's. In steps shorter than the model's what it learned counts as
                         * an acceleration would */
    double length_unit; /* metres in one unit of the host's length; 0 = 1. 0.01 for centimetres */
    double max_displacement; /* length unit a particle may move in a (sub)step, else RANGE; 0 = 64
                              * spacings, INFINITY = no bound */
    int32_t max_neighbors;   /* most neighbours of one point before LIMIT is returned; 0 = 4096 */
    int32_t substeps; /* what a time step is cut into, equal steps, so that the length of each,
                              * gravity and the way of the fastest particle (but for a few that nobody
                              * can meet) lie in the range that the model was trained for
                              * (ascc_model_info): 0 = as many as it takes, n = at most n, else RANGE;
                              * -1 = none, whatever the range */
    /* Parts of the fluid that stay slower for half a second stop, until something wakes them (docs/sleeping.md);
     * in speeds that gravity gives in a time step: 0.5 is a good one. 0 = none stops, and what had stopped wakes. */
    double sleep_speed;
    /* 1: the statistics tell how far what a step sees is from what the model was trained on (docs/trust.md), if the
     * model can tell (ascc_model_info.tells_distance). Costs 1 to 2 % of a step, and changes nothing of it. */
    int32_t measure_distance;
    int32_t reserved;
} ascc_step_options;

/**
 * Makes a step. Model and context may be destroyed before it.
 *
 * options   NULL for all defaults; read during the call.
 * errors    ARGUMENT (a value negative or not finite), MEMORY.
 */
ASCC_API ascc_status ascc_step_create(ascc_context *context, const ascc_model *model,
                                      const ascc_step_options *options, ascc_step **step);
ASCC_API void ascc_step_destroy(ascc_step **step);

/**
 * Bytes of scratch that a step of this many particles is expected to need, for a scene near rest
 * density; within a factor of two for a compact one. 0 if step is none.
 */
ASCC_API size_t ascc_step_estimate(const ascc_step *step, size_t fluid, size_t boundary);

/**
 * Makes that much scratch at once, so that the first steps of such a scene need not grow it.
 * errors: ARGUMENT, MEMORY; on error the step is as before.
 */
ASCC_API ascc_status ascc_step_reserve(ascc_step *step, size_t fluid, size_t boundary);

/** What acts on the fluid from outside during ascc_step_run; NULL pointers are the defaults. */
typedef struct ascc_forces {
    size_t size;           /* sizeof(ascc_forces) */
    const double *gravity; /* [dimension], length unit / s^2; NULL = the model's */
    const ascc_const_array
        *acceleration; /* [fluid count][dimension], added to gravity; NULL = none */
} ascc_forces;

/**
 * Advances the fluid by `count` time steps (docs/method.md). Bodies go on with their velocities and spins. So do
 * other walls with their own velocities, which are taken to be constant all the while, and their normals stay
 * as they are; what turns there or speeds up is set anew before each step, `count` 1. A position of a wall is
 * that at the beginning of a step.
 *
 * forces    NULL = the model's gravity alone.
 * Any spacing will do: a scene of others than the model's is the same scene at the model's, lengths times the
 * ratio of the spacings, in metres, and time with its root, so that gravity is what it was.
 *
 * errors    ARGUMENT, MISMATCH (dimension), MEMORY (scratch had to grow), NOT_FINITE, RANGE (also what no number
 *           of substeps brings into the model's range), LIMIT.
 *           Each step is a transaction: on error the set is, bit for bit, as after the last step that
 *           succeeded; ascc_step_statistics says how many did. Particles may be up to 3e10 of the
 *           model's largest radius from the origin; RANGE names the row of one that is farther.
 * cost      O(neighbour pairs). Scratch grows to the largest scene seen and is then reused.
 * promise   With an antisymmetric last layer: the integer momentum of the fluid changes by the
 *           external impulse and by what walls received (and the support of fluid that sleeps), and by nothing else. Same input, same bits
 *           out, for any thread_count, host task order, CPU, and order of the particles.
 * threads   one thread at a time per step and per particle set.
 */
ASCC_API ascc_status ascc_step_run(ascc_step *step, ascc_particles *particles,
                                   const ascc_forces *forces, int32_t count);

/** A stage of the step and the time that a run spent in it. */
typedef struct ascc_stage_time {
    const char *name; /* the library's, for ever */
    double seconds;   /* wall clock */
} ascc_stage_time;
#define ASCC_MAX_STAGES 24

/** Density over rest density less 1, where it is above 0: over all fluid particles. */
typedef struct ascc_compression {
    double mean, largest;
} ascc_compression;

/** What ascc_step_get_statistics tells of the last ascc_step_run. */
typedef struct ascc_step_statistics {
    size_t size;          /* sizeof(ascc_step_statistics) */
    int32_t steps;        /* that succeeded in the last run */
    int32_t level_count;  /* entries used of level_points */
    int32_t substeps;     /* that the last step was cut into */
    int32_t stage_count;  /* entries used of stage */
    double seconds_total; /* wall clock, of the run */
    /* By stage, in order: "forces" (and advection), "sight" (features, sorting and sampling of the levels),
     * "search" (neighbour lists), "network" (all layers but the last), "pairs" (pair impulses), "advance"
     * (new momenta and positions), "relaxation", "contact", "divergence", "commit". More may come. */
    ascc_stage_time stage[ASCC_MAX_STAGES];
    /* Of the last step: */
    uint64_t level_points[16]; /* points on each level; level 0: fluid and the walls it sees */
    uint64_t pair_count;       /* neighbour pairs of the last layer, unordered */
    uint64_t neighbor_count;   /* entries of all neighbour lists */
    uint64_t max_neighbors;    /* of one point in one list */
    uint64_t scratch_size;     /* bytes the step holds */
    /* Of the run, quanta of momentum, exact; [2] is 0 in 2D. before + external - wall = after, if the
     * model conserves momentum; else the difference is what its last layer made or lost. */
    int64_t momentum_before[3], momentum_after[3], external_impulse[3], wall_impulse[3];
    /* Of the last step, if the model has a relaxation (docs/method.md): before it, and as its last sweep
     * began, by what sweeps predict; and how many there were. */
    ascc_compression compression_before, compression_after;
    uint64_t sweeps;
    uint64_t substeps_total; /* of the run */
    /* Fluid particles that slept in the last step, and what they had and received over the run, quanta: with them,
     * before + external - wall - support = after. */
    uint64_t asleep;
    int64_t support_impulse[3];
    /* Of the last step, with measure_distance: how far what fluid particles see is from what the model was trained
     * on, 1 = as far as there in the mean; in the mean over distance_count particles (0: nothing was measured), and
     * of the worst, whose row of the fluid distance_row was as the step began. */
    double distance_mean, distance_worst;
    uint64_t distance_row, distance_count;
} ascc_step_statistics;

ASCC_API ascc_status ascc_step_get_statistics(const ascc_step *step,
                                              ascc_step_statistics *statistics);

/** The message of the last call on this step that failed, or "". The step's, until its next call. */
ASCC_API const char *ascc_step_message(const ascc_step *step);

/* ---- Ladder: several models of one fluid, the best that a budget of time allows --------------- */

typedef struct ascc_ladder ascc_ladder;
#define ASCC_MAX_RUNGS 16

/** Options of ascc_ladder_create. */
typedef struct ascc_ladder_options {
    size_t size;   /* sizeof(ascc_ladder_options) */
    double budget; /* s of the clock that a time step may take; 0 = any: always the top rung */
    double dwell;  /* s of simulated time between two changes, at least; 0 = 1 */
    /* What a step's time is taken by: seconds that never run backwards. Called before and after each step on
     * the calling thread. NULL = the wall clock. A clock of CPU time leaves other programs out. */
    double (*clock)(void *user);
    void *user;                    /* handed to the clock */
    const ascc_step_options *step; /* of all rungs; NULL = defaults */
    /* Mean distance of what a network sees from what it was trained on (docs/trust.md) beyond which the next steps
     * run on the best rung below that has no network, such as pbf3d, `dwell` long at least. ascc_model_info has one
     * to begin with. 0 = none. */
    double max_distance;
} ascc_ladder_options;

/** Why the last step ran on its rung. */
typedef enum ascc_ladder_reason {
    ASCC_LADDER_FITS = 0,     /* the best rung that the budget allows, or there is no budget */
    ASCC_LADDER_FELL = 1,     /* changed: the rung before was about to exceed the budget */
    ASCC_LADDER_CLIMBED = 2,  /* changed: a better one fits */
    ASCC_LADDER_WAITS = 3,    /* another one is wanted, but the last change is not `dwell` ago */
    ASCC_LADDER_TOO_SLOW = 4, /* the budget is exceeded, and no rung is faster */
    ASCC_LADDER_GIVEN = 5,    /* by ascc_ladder_replay */
    ASCC_LADDER_STRANGE = 6, /* what the fluid does is too far from what a network was trained on */
} ascc_ladder_reason;

/**
 * Makes a ladder (docs/budget.md).
 *
 * models    [count], 1 to ASCC_MAX_RUNGS, the best last: such as pbf3d, water3d, water3d-large. Of one
 *           dimension, spacing, gravity, and time step unless options->step says one. May be destroyed before.
 * options   NULL for all defaults; read during the call.
 * errors    ARGUMENT, MISMATCH (models that do not go together; with max_distance: a network that cannot tell its
 *           distance, or without a rung below that has none), MEMORY.
 * cost      each rung holds a step with its own scratch.
 * threads   one thread at a time per ladder and per particle set.
 */
ASCC_API ascc_status ascc_ladder_create(ascc_context *context, size_t count,
                                        const ascc_model *const *models,
                                        const ascc_ladder_options *options, ascc_ladder **ladder);
ASCC_API void ascc_ladder_destroy(ascc_ladder **ladder);

/**
 * Advances the fluid by `count` time steps, as ascc_step_run, each on the best rung that is expected to stay within
 * the budget. What a rung costs is taken from its last steps; a first step with a budget measures all rungs before
 * it (ascc_ladder_measure). The choice depends on the clock; all else is as promised of ascc_step_run: the choices
 * made (ascc_ladder_get_choices) give the same bits again (ascc_ladder_replay).
 *
 * Fluid with an ASCC_DETAIL above 0 is computed by the best model to that share, whatever the rung (docs/budget.md).
 *
 * errors    as ascc_step_run, also MISMATCH where detail is wanted and the rung's model and the best cannot share a step;
 *           ascc_ladder_message names the rung.
 */
ASCC_API ascc_status ascc_ladder_run(ascc_ladder *ladder, ascc_particles *particles,
                                     const ascc_forces *forces, int32_t count);

/** As ascc_ladder_run, on the given rungs, int32_t[count]; these become the ladder's choices. errors: also
 * ARGUMENT (a rung that does not exist; then nothing ran). */
ASCC_API ascc_status ascc_ladder_replay(ascc_ladder *ladder, ascc_particles *particles,
                                        const ascc_forces *forces, const int32_t *rungs,
                                        int32_t count);

/**
 * Takes the time of each rung on this set: two steps, taken back. Worth a call while a scene loads: without it the
 * first step with a budget takes as long. errors: as ascc_step_run; the set is as it was either way.
 */
ASCC_API ascc_status ascc_ladder_measure(ascc_ladder *ladder, ascc_particles *particles,
                                         const ascc_forces *forces);

/** Another budget from the next step on, s; 0 = any. errors: ARGUMENT. */
ASCC_API ascc_status ascc_ladder_set_budget(ascc_ladder *ladder, double budget);

/** What ascc_ladder_get_statistics tells. */
typedef struct ascc_ladder_statistics {
    size_t size;        /* sizeof(ascc_ladder_statistics) */
    int32_t rung_count; /* entries used of the arrays */
    int32_t steps;      /* that succeeded in the last run */
    int32_t rung;       /* of the last step, numbered from 0 */
    int32_t reason;     /* for it, an ascc_ladder_reason */
    double seconds;     /* that it took, by the clock */
    double budget;      /* s */
    double predicted
        [ASCC_MAX_RUNGS]; /* s, for one more step of that set on each rung; 0 = not measured */
    /* Since the ladder was made, or restored: */
    uint64_t steps_on[ASCC_MAX_RUNGS];
    uint64_t changes; /* of rung */
    uint64_t late;    /* steps that took longer than the budget */
    /* Of the last run, quanta of momentum, exact, as in ascc_step_statistics. */
    int64_t momentum_before[3], momentum_after[3], external_impulse[3], wall_impulse[3];
    int64_t support_impulse[3];
    /* As in ascc_step_statistics, of the last step whose rung is measured, with max_distance or measure_distance. */
    double distance_mean, distance_worst;
    uint64_t distance_row, distance_count;
    /* Of the last step: fluid particles that each rung computed, those between two (ASCC_DETAIL) by both. */
    uint64_t particles_on[ASCC_MAX_RUNGS];
} ascc_ladder_statistics;

ASCC_API ascc_status ascc_ladder_get_statistics(const ascc_ladder *ladder,
                                                ascc_ladder_statistics *statistics);

/** The step of a rung, for ascc_step_get_statistics: the ladder's. NULL if there is no such rung. */
ASCC_API const ascc_step *ascc_ladder_step(const ascc_ladder *ladder, int32_t rung);

/** Steps that have run since the ladder was made, those before a snapshot included. */
ASCC_API uint64_t ascc_ladder_step_count(const ascc_ladder *ladder);

/** The rungs of steps [first, first + count), int32_t[count], for ascc_ladder_replay. errors: ARGUMENT. */
ASCC_API ascc_status ascc_ladder_get_choices(const ascc_ladder *ladder, uint64_t first,
                                             size_t count, int32_t *rungs);

/** Bytes ascc_ladder_snapshot needs: they grow with the number of changes. */
ASCC_API size_t ascc_ladder_snapshot_size(const ascc_ladder *ladder);

/**
 * Writes choices so far and what is known of the rungs' cost, to be kept beside a snapshot of the particles. A
 * ladder restored from it chooses as this one would, given the same times. errors: ARGUMENT (capacity too small).
 */
ASCC_API ascc_status ascc_ladder_snapshot(const ascc_ladder *ladder, void *memory, size_t capacity);

/** errors: ARGUMENT, FORMAT (not a ladder's snapshot, or damaged), MISMATCH (another number of rungs), MEMORY; on
 * error the ladder is unchanged. Budget, dwell and clock stay the ladder's own. */
ASCC_API ascc_status ascc_ladder_restore(ascc_ladder *ladder, const void *memory, size_t size);

/** The message of the last call on this ladder that failed, or "". The ladder's, until its next call. */
ASCC_API const char *ascc_ladder_message(const ascc_ladder *ladder);

#ifdef __cplusplus
}
#endif

#endif
