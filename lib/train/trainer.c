/* Iterations: draws rollouts, adds up their gradients in order, and moves the weights.
 * SPDX-License-Identifier: MIT */
#include "trainer.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define FAIL(...) ascc_trainer_fail(t, __VA_ARGS__)
#define REFUSE(status, ...) ascc_fail(&t->message, status, __VA_ARGS__) /* in creation */

#define MOST_FAILURES 20 /* iterations in a row without any rollout that end training */

/* ---- Creation ---- */

static void *take(ascc_trainer *t, size_t count, size_t element)
{
    void *memory = ascc_allocate(&t->allocator, count, element);
    if (memory)
        memset(memory, 0, count * element);
    return memory;
}

static void give(ascc_trainer *t, void *memory, size_t count, size_t element)
{
    if (memory)
        ascc_release(&t->allocator, memory, count, element);
}

/* The first released layouts. */
#define FIRST_OPTIONS_SIZE (offsetof(ascc_trainer_options, whiten) + sizeof(int32_t))
#define FIRST_STAGE_SIZE sizeof(ascc_training_stage)
#define FIRST_SEQUENCE_SIZE offsetof(ascc_training_sequence, warm_up)
#define FIRST_REPORT_SIZE sizeof(ascc_training_report)
_Static_assert(sizeof(void *) != 8 || FIRST_OPTIONS_SIZE == 144, "layout is part of the ABI");
_Static_assert(FIRST_STAGE_SIZE == 32, "layout is part of the ABI");
_Static_assert(sizeof(void *) != 8 || FIRST_SEQUENCE_SIZE == 104, "layout is part of the ABI");
_Static_assert(sizeof(void *) != 8 || FIRST_REPORT_SIZE == 72, "layout is part of the ABI");

/* Stages of the caller's size, which only grows: what this version does not know must be zeros. */
static ascc_status read_stages(ascc_trainer *t)
{
    const ascc_trainer_options *o = &t->options;
    if (o->stage_count < 1 || !o->stage)
        return REFUSE(ASCC_ERROR_ARGUMENT, "options: no stage");
    if (o->stage_size < FIRST_STAGE_SIZE || o->stage_size > 4096)
        return REFUSE(ASCC_ERROR_ARGUMENT, "options: stage_size is not understood");
    t->stage = take(t, (size_t)o->stage_count, sizeof *t->stage);
    if (!t->stage)
        return ASCC_ERROR_MEMORY;
    t->stage_count = o->stage_count;
    for (int32_t i = 0; i < o->stage_count; i++) {
        const unsigned char *from = (const unsigned char *)o->stage + (size_t)i * o->stage_size;
        ascc_training_stage *s = &t->stage[i];
        memcpy(s, from, sizeof *s);
        for (size_t k = sizeof *s; k < o->stage_size; k++)
            if (from[k])
                return REFUSE(ASCC_ERROR_ARGUMENT,
                              "options: stage %d: a member that this version does not know",
                              (int)i);
        if (s->unroll < 1 || s->unroll > 1000 || s->warm_up < 0 || s->warm_up > 10000 ||
            !(s->learning_rate > 0.0) || !(s->learning_rate_end >= 0.0) ||
            !isfinite(s->learning_rate + s->learning_rate_end) ||
            s->end <= (i ? t->stage[i - 1].end : 0))
            return REFUSE(ASCC_ERROR_ARGUMENT,
                          "options: stage %d: end must ascend, unroll be 1 to 1000, warm_up 0 to "
                          "10000, learning rates positive",
                          (int)i);
    }
    return ASCC_OK;
}

static ascc_status read_options(ascc_trainer *t, const ascc_trainer_options *given)
{
    ascc_trainer_options *o = &t->options;
    if (!ascc_read_struct(o, sizeof *o, given, FIRST_OPTIONS_SIZE))
        return REFUSE(ASCC_ERROR_ARGUMENT, "ascc_trainer_options.size is not understood");
    const double numbers[] = {o->beta1,       o->beta2,          o->epsilon,        o->clip,
                              o->average,     o->jitter,         o->density_weight, o->wall_weight,
                              o->truth_share, o->velocity_weight};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        if (!(numbers[i] >= 0.0 && isfinite(numbers[i])))
            return REFUSE(ASCC_ERROR_ARGUMENT, "options: a number is negative or not finite");
    if (o->beta1 >= 1.0 || o->beta2 >= 1.0 || o->average >= 1.0 || o->batch < 0 ||
        o->batch > 65536 || !isfinite(o->neighbor_weight) || o->truth_share > 1.0)
        return REFUSE(ASCC_ERROR_ARGUMENT,
                      "options: beta1, beta2 and average must be below 1, truth_share at most 1, "
                      "batch within 0 and 65536");
    if (o->whiten < -1 || o->whiten > 0)
        return REFUSE(ASCC_ERROR_ARGUMENT, "options: whiten is 0 or -1");
    if (o->relaxation_gradients < -1 || o->relaxation_gradients > 0)
        return REFUSE(ASCC_ERROR_ARGUMENT, "options: relaxation_gradients is 0 or -1");
    if (o->learn > 15 || o->reserved || (o->learn && o->relaxation_gradients))
        return REFUSE(ASCC_ERROR_ARGUMENT,
                      "options: learn is a sum of ascc_learn, and needs relaxation_gradients 0");
    o->batch = o->batch ? o->batch : 8;
    o->beta1 = o->beta1 > 0.0 ? o->beta1 : 0.9;
    o->beta2 = o->beta2 > 0.0 ? o->beta2 : 0.999;
    o->epsilon = o->epsilon > 0.0 ? o->epsilon : 1e-8;
    o->clip = o->clip > 0.0 ? o->clip : 1.0;
    o->neighbor_weight = o->neighbor_weight == 0.0 ? 1.0 : fmax(o->neighbor_weight, 0.0);
    o->memory_limit = o->memory_limit ? o->memory_limit : (size_t)4 << 30;
    t->batch = o->batch;
    return read_stages(t);
}

/* A tensor that may hold no negative numbers, by its first weight. */
static bool damps(const ascc_plan *plan, const float *weights)
{
    for (int32_t n = 0; n <= plan->term_count; n++) {
        const ascc_term *term = ascc_plan_term(plan, n);
        for (int i = 0; i < ASCC_MAX_TENSORS; i++)
            if (term->tensor[i] == weights && term->operation->not_negative >> i & 1)
                return true;
    }
    return false;
}

/* The tensors' places: the model arranges them in the order of the file (ascc_plan_align). */
static ascc_status find_tensors(ascc_trainer *t)
{
    const ascc_plan *plan = &t->model->plan;
    size_t offset = 0;
    t->tensor_count = t->file.tensor_count;
    t->tensor = take(t, t->tensor_count, sizeof *t->tensor);
    if (!t->tensor)
        return ASCC_ERROR_MEMORY;
    for (size_t i = 0; i < t->tensor_count; i++) {
        const ascc_tensor *tensor = &t->file.tensor[i];
        const float *weights = t->model->weights + offset;
        if (strcmp(tensor->type, "F32") != 0)
            return REFUSE(ASCC_ERROR_FORMAT, "tensor '%s' is %s; only F32 can be trained",
                          tensor->name, tensor->type);
        t->tensor[i] = (ascc_trained_tensor){.first = t->parameter_count,
                                             .count = tensor->count,
                                             .offset = offset,
                                             .damps = damps(plan, weights)};
        t->parameter_count += tensor->count;
        offset += ascc_plan_align(tensor->count);
    }
    return ASCC_OK;
}

static ascc_status take_arrays(ascc_trainer *t)
{
    const size_t batch = (size_t)t->batch, threads = (size_t)t->thread_count;
    int32_t longest = 1;
    for (int32_t i = 0; i < t->stage_count; i++)
        longest = t->stage[i].unroll > longest ? t->stage[i].unroll : longest;
    t->worker = take(t, threads, sizeof *t->worker);
    for (size_t i = 0; t->worker && i < threads; i++)
        if (!ascc_rollout_worker_open(&t->worker[i], t->context, t->model, longest))
            return ASCC_ERROR_MEMORY;
    if (!t->worker ||
        !ascc_transposed_create(&t->transposed, &t->allocator, &t->model->plan, &t->model->packed))
        return ASCC_ERROR_MEMORY;
    const size_t packed = t->model->packed.count;
    t->packed = take(t, threads * packed, sizeof *t->packed);
    t->gradients = take(t, batch * t->model->weight_count, sizeof *t->gradients);
    t->gradient = take(t, t->parameter_count, sizeof *t->gradient);
    t->step = take(t, t->parameter_count, sizeof *t->step);
    t->task = take(t, batch, sizeof *t->task);
    t->result = take(t, batch, sizeof *t->result);
    t->weights = take(t, 4 * t->parameter_count, sizeof *t->weights);
    t->before = take(t, 4 * t->parameter_count, sizeof *t->before);
    if (!t->packed || !t->gradients || !t->gradient || !t->step || !t->task || !t->result ||
        !t->weights || !t->before)
        return ASCC_ERROR_MEMORY;
    t->average = t->weights + t->parameter_count;
    t->moment1 = t->average + t->parameter_count;
    t->moment2 = t->moment1 + t->parameter_count;
    for (size_t i = 0; i < t->tensor_count; i++)
        memcpy(t->weights + t->tensor[i].first, t->model->weights + t->tensor[i].offset,
               t->tensor[i].count * sizeof *t->weights);
    memset(t->weights + t->learned.first, 0, t->learned.count * sizeof *t->weights);
    memcpy(t->average, t->weights, t->parameter_count * sizeof *t->average);
    return t->options.whiten < 0 ? ASCC_OK
                                 : ascc_whitening_create(&t->whitening, &t->allocator, t->model,
                                                         t->tensor, t->tensor_count);
}

/* Two copies of the model's file, with room for what is learned in its header. */
static ascc_status copy_file(ascc_trainer *t, const void *model, size_t size)
{
    ascc_status status =
        ascc_learned_open(&t->learned, t->options.learn, &t->model->plan, &t->message);
    if (status == ASCC_OK && t->learned.count)
        status = ascc_learned_make_room(&t->learned, &t->allocator, model, size, &t->bytes,
                                        &t->byte_count, &t->message);
    if (status != ASCC_OK)
        return status;
    if (!t->bytes) {
        t->byte_count = size;
        t->bytes = take(t, size, 1);
        if (t->bytes)
            memcpy(t->bytes, model, size);
    }
    t->averaged_bytes = take(t, t->byte_count, 1);
    if (!t->bytes || !t->averaged_bytes)
        return ASCC_ERROR_MEMORY;
    memcpy(t->averaged_bytes, t->bytes, t->byte_count);
    return ASCC_OK;
}

static ascc_status open_model(ascc_trainer *t, const void *model, size_t size)
{
    ascc_status status = ascc_model_load_memory(t->context, model, size, &t->model);
    if (status != ASCC_OK) {
        char text[ASCC_MESSAGE_CAPACITY];
        ascc_context_message(t->context, text, sizeof text);
        return REFUSE(status, "%s", text);
    }
    status = copy_file(t, model, size);
    if (status == ASCC_OK)
        status =
            ascc_safetensors_open(&t->allocator, t->bytes, t->byte_count, &t->file, &t->message);
    if (status == ASCC_OK)
        status = ascc_safetensors_open(&t->allocator, t->averaged_bytes, t->byte_count,
                                       &t->averaged_file, &t->message);
    if (status != ASCC_OK)
        return status;
    if (!ascc_safetensors_metadata(&t->file, "network"))
        return REFUSE(ASCC_ERROR_FORMAT,
                      "model: only files of the format 'ascc.model' can be trained");
    uint64_t length = 0;
    for (int i = 7; i >= 0; i--)
        length = length << 8 | t->bytes[i];
    t->header_count = 8 + (size_t)length;
    status = find_tensors(t);
    t->learned.first = t->parameter_count;
    t->parameter_count += t->learned.count;
    return status;
}

static ascc_status make(ascc_train_context *context, const ascc_trainer_options *options,
                        const void *model, size_t model_size, ascc_trainer **trainer,
                        ascc_message *message)
{
    const ascc_allocator *allocator = &context->shared->allocator;
    ascc_trainer *t = ascc_allocate(allocator, 1, sizeof *t);
    if (!t)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory for the trainer");
    memset(t, 0, sizeof *t);
    t->magic = ASCC_TRAINER_MAGIC;
    t->allocator = *allocator;
    t->shared = context->shared;
    t->context = context->alone;
    t->thread_count = ascc_workers_count(t->shared->workers);
    ascc_context_retain(t->shared);
    ascc_context_retain(t->context);
    ascc_status status = read_options(t, options);
    if (status == ASCC_OK)
        status = open_model(t, model, model_size);
    if (status == ASCC_OK)
        status = take_arrays(t);
    if (status == ASCC_ERROR_MEMORY)
        ascc_fail(&t->message, status, "no memory for the trainer");
    if (status == ASCC_OK) {
        *trainer = t;
        return ASCC_OK;
    }
    *message = t->message;
    ascc_trainer_destroy(&t);
    return status;
}

ascc_status ascc_trainer_create(ascc_train_context *context, const ascc_trainer_options *options,
                                const void *model, size_t model_size, ascc_trainer **trainer)
{
    ASCC_FLOAT_SCOPE;
    ascc_message message = {""};
    if (trainer)
        *trainer = NULL;
    if (!ascc_train_context_alive(context))
        return ASCC_ERROR_ARGUMENT;
    const ascc_status status =
        options && model && trainer
            ? make(context, options, model, model_size, trainer, &message)
            : ascc_fail(&message, ASCC_ERROR_ARGUMENT, "trainer: a NULL argument");
    return status == ASCC_OK ? status : ascc_train_context_fail(context, status, &message);
}

void ascc_trainer_destroy(ascc_trainer **trainer)
{
    if (!trainer || !*trainer)
        return;
    ascc_trainer *t = *trainer;
    if (!ascc_trainer_alive(t))
        return;
    *trainer = NULL;
    const size_t batch = (size_t)t->batch, threads = (size_t)t->thread_count;
    const size_t packed = t->model ? t->model->packed.count : 0;
    ascc_transposed_destroy(&t->transposed, &t->allocator);
    for (size_t i = 0; t->worker && i < threads; i++)
        ascc_rollout_worker_close(&t->worker[i]);
    for (size_t i = 0; i < t->sequence_count; i++)
        ascc_kept_sequence_destroy(&t->sequence[i], &t->allocator);
    give(t, t->worker, threads, sizeof *t->worker);
    give(t, t->stage, (size_t)t->stage_count, sizeof *t->stage);
    give(t, t->sequence, t->sequence_capacity, sizeof *t->sequence);
    give(t, t->packed, threads * packed, sizeof *t->packed);
    give(t, t->gradients, t->model ? batch * t->model->weight_count : 0, sizeof *t->gradients);
    give(t, t->gradient, t->parameter_count, sizeof *t->gradient);
    give(t, t->step, t->parameter_count, sizeof *t->step);
    ascc_whitening_destroy(&t->whitening, &t->allocator);
    give(t, t->task, batch, sizeof *t->task);
    give(t, t->result, batch, sizeof *t->result);
    give(t, t->weights, 4 * t->parameter_count, sizeof *t->weights);
    give(t, t->before, 4 * t->parameter_count, sizeof *t->before);
    give(t, t->tensor, t->tensor_count, sizeof *t->tensor);
    give(t, t->text, t->text_capacity, 1);
    if (t->file.tensor)
        ascc_safetensors_close(&t->file);
    if (t->averaged_file.tensor)
        ascc_safetensors_close(&t->averaged_file);
    give(t, t->bytes, t->byte_count, 1);
    give(t, t->averaged_bytes, t->byte_count, 1);
    ascc_model_destroy(&t->model);
    ascc_context *shared = t->shared;
    ascc_context_release(t->context);
    t->magic = 0;
    ascc_release(&shared->allocator, t, 1, sizeof *t);
    ascc_context_release(shared);
}

ascc_status ascc_trainer_fail(ascc_trainer *t, ascc_status status, const char *format, ...)
{
    char text[ASCC_MESSAGE_CAPACITY];
    va_list arguments;
    va_start(arguments, format);
    if (vsnprintf(text, sizeof text, format, arguments) < 0)
        text[0] = '\0';
    va_end(arguments);
    ascc_fail(&t->message, status, "%s", text);
    ascc_context_log(t->shared, t->message.text);
    return status;
}

const char *ascc_trainer_message(const ascc_trainer *t)
{
    return ascc_trainer_alive(t) ? t->message.text : "";
}

uint64_t ascc_trainer_iteration(const ascc_trainer *t)
{
    return ascc_trainer_alive(t) ? t->iteration : 0;
}

/* ---- Parameters ---- */

size_t ascc_trainer_parameter_count(const ascc_trainer *t)
{
    return ascc_trainer_alive(t) ? t->parameter_count : 0;
}

ascc_status ascc_trainer_get_parameters(const ascc_trainer *t, float *values)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_trainer_alive(t) || !values)
        return ASCC_ERROR_ARGUMENT;
    memcpy(values, t->weights, t->parameter_count * sizeof *values);
    return ASCC_OK;
}

void ascc_trainer_apply(ascc_trainer *t)
{
    for (size_t i = 0; i < t->tensor_count; i++)
        memcpy(t->model->weights + t->tensor[i].offset, t->weights + t->tensor[i].first,
               t->tensor[i].count * sizeof *t->weights);
    ascc_learned_apply(&t->learned, t->weights + t->learned.first, &t->model->plan);
    ascc_packed_update(&t->model->packed, &t->model->plan);
    ascc_transposed_update(&t->transposed, &t->model->plan, &t->model->packed);
}

ascc_status ascc_trainer_set_parameters(ascc_trainer *t, const float *values)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_trainer_alive(t))
        return ASCC_ERROR_ARGUMENT;
    if (!values)
        return FAIL(ASCC_ERROR_ARGUMENT, "trainer: a NULL argument");
    for (size_t i = 0; i < t->tensor_count; i++)
        for (size_t k = t->tensor[i].first; k < t->tensor[i].first + t->tensor[i].count; k++)
            if (!isfinite(values[k]) || (t->tensor[i].damps && values[k] < 0.0f))
                return FAIL(ASCC_ERROR_ARGUMENT,
                            "tensor '%s': number %zu is not finite, or negative where it damps",
                            t->file.tensor[i].name, k - t->tensor[i].first);
    if (!ascc_learned_takes(&t->learned, values + t->learned.first))
        return FAIL(
            ASCC_ERROR_ARGUMENT,
            "constants of the relaxation: one is not finite, or none that a model may have");
    memcpy(t->weights, values, t->parameter_count * sizeof *values);
    t->changed = false;
    memcpy(t->average, values, t->parameter_count * sizeof *values);
    ascc_trainer_apply(t);
    return ASCC_OK;
}

/* ---- Gradients ---- */

/* Gradient by parameter from one laid out as the model's weights and one of constants, times a share. */
static void add_gradient(ascc_trainer *t, const float *laid_out,
                         const ascc_constant_gradients *constants, float share, float *to)
{
    ascc_learned_add_gradient(&t->learned, constants, t->weights + t->learned.first, share,
                              to + t->learned.first);
    for (size_t i = 0; i < t->tensor_count; i++) {
        const ascc_trained_tensor *tensor = &t->tensor[i];
        const float *from = laid_out + tensor->offset;
        for (size_t k = 0; k < tensor->count; k++)
            to[tensor->first + k] += share * from[k];
    }
}

static ascc_rollout_task make_task(const ascc_trainer *t, size_t sequence)
{
    return (ascc_rollout_task){
        .sequence = &t->sequence[sequence],
        .transform = ascc_rigid_transform_none(),
        .neighbor_weight = t->options.neighbor_weight,
        .density_weight = t->options.density_weight,
        .wall_weight = t->options.wall_weight,
        .velocity_weight = t->options.velocity_weight,
        .position_gradients = t->options.position_gradients != 0,
        .relaxation_gradients = t->options.relaxation_gradients >= 0,
        .backward = true,
        .memory_limit = t->options.memory_limit / (size_t)t->thread_count,
    };
}

static ascc_status rollout_failure(ascc_trainer *t, const ascc_rollout_task *task,
                                   const ascc_rollout_result *result)
{
    if (result->status == ASCC_ERROR_MEMORY)
        return FAIL(ASCC_ERROR_MEMORY, "no memory for a rollout of sequence %s",
                    task->sequence->name);
    return FAIL(result->status, "sequence %s, frame %zu: %s", task->sequence->name,
                result->failed_frame, ascc_status_text(result->status));
}

ascc_status ascc_trainer_gradient(ascc_trainer *t, size_t sequence, size_t frame, int32_t warm_up,
                                  int32_t unroll, double *loss, float *gradient)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_trainer_alive(t))
        return ASCC_ERROR_ARGUMENT;
    if (!loss)
        return FAIL(ASCC_ERROR_ARGUMENT, "trainer: a NULL argument");
    if (sequence >= t->sequence_count || frame < 1 || warm_up < 0 || unroll < 1 ||
        (size_t)unroll > t->worker[0].kept_count ||
        frame + (size_t)warm_up + (size_t)unroll >= t->sequence[sequence].frame_count)
        return FAIL(ASCC_ERROR_ARGUMENT,
                    "no such sequence, or frame, warm_up and unroll lie beyond it or the stages");
    ascc_rollout_task task = make_task(t, sequence);
    task.frame = frame;
    task.warm_up = warm_up;
    task.unroll = unroll;
    task.backward = gradient != NULL;
    memset(t->gradients, 0, t->model->weight_count * sizeof *t->gradients);
    const ascc_rollout_result result =
        ascc_rollout_run(&t->worker[0], &t->transposed, &task, t->packed, t->gradients);
    if (result.status != ASCC_OK)
        return rollout_failure(t, &task, &result);
    if (result.skipped)
        return FAIL(ASCC_ERROR_RANGE, "sequence %s, frame %zu: the step could not be computed",
                    task.sequence->name, result.failed_frame);
    *loss = result.loss;
    if (gradient) {
        memset(gradient, 0, t->parameter_count * sizeof *gradient);
        add_gradient(t, t->gradients, &result.constants, 1.0f, gradient);
    }
    return ASCC_OK;
}

/* ---- One iteration ---- */

ascc_status ascc_trainer_add_sequence(ascc_trainer *t, const ascc_training_sequence *sequence)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_trainer_alive(t))
        return ASCC_ERROR_ARGUMENT;
    if (!sequence)
        return FAIL(ASCC_ERROR_ARGUMENT, "trainer: a NULL argument");
    ascc_training_sequence given;
    if (!ascc_read_struct(&given, sizeof given, sequence, FIRST_SEQUENCE_SIZE))
        return FAIL(ASCC_ERROR_ARGUMENT, "ascc_training_sequence.size is not understood");
    void *memory = t->sequence;
    if (!ascc_grow(&t->allocator, &memory, &t->sequence_capacity, t->sequence_count + 1,
                   sizeof *t->sequence))
        return FAIL(ASCC_ERROR_MEMORY, "no memory for a sequence");
    t->sequence = memory;
    ascc_arena_reset(&t->worker[0].loss_scratch);
    const ascc_search_tools tools = {&t->worker[0].loss_scratch, t->context->workers,
                                     &t->context->kernels, &t->message};
    const ascc_status status = ascc_kept_sequence_create(
        &t->sequence[t->sequence_count], &t->allocator, &t->model->plan, &given, &tools);
    if (status != ASCC_OK)
        return FAIL(status, "%s", t->message.text);
    t->sequence_count++;
    return ASCC_OK;
}

static const ascc_training_stage *find_stage(const ascc_trainer *t, double *rate)
{
    int32_t i = 0;
    while (i < t->stage_count - 1 && t->iteration >= t->stage[i].end)
        i++;
    const ascc_training_stage *s = &t->stage[i];
    const double begin = i ? (double)t->stage[i - 1].end : 0.0;
    const double at = fmin(((double)t->iteration - begin) / ((double)s->end - begin), 1.0);
    *rate = s->learning_rate_end > 0.0
                ? s->learning_rate * pow(s->learning_rate_end / s->learning_rate, at)
                : s->learning_rate;
    return s;
}

/* Frames that a rollout with this many steps can start from. */
static size_t starts_of(const ascc_kept_sequence *s, const ascc_training_stage *stage,
                        int32_t warm_up)
{
    const size_t steps = (size_t)warm_up + (size_t)stage->unroll;
    return s->frame_count > steps + 1 ? s->frame_count - 1 - steps : 0;
}

static int32_t warm_up_of(const ascc_kept_sequence *s, const ascc_training_stage *stage)
{
    return s->warm_up > 0 && s->warm_up < stage->warm_up ? s->warm_up : stage->warm_up;
}

ascc_status ascc_trainer_draw(ascc_trainer *t, const ascc_training_stage *stage, ascc_random random,
                              ascc_rollout_task *task)
{
    const double share = t->options.truth_share, drawn = ascc_random_uniform(&random);
    double sum = 0.0, edge = t->model->plan.spacing;
    for (size_t i = 0; i < t->sequence_count; i++)
        sum += starts_of(&t->sequence[i], stage, 0) ? t->sequence[i].share : 0.0;
    if (sum == 0.0)
        return FAIL(ASCC_ERROR_ARGUMENT, "no sequence is long enough for %d steps",
                    (int)stage->unroll);
    double at = ascc_random_uniform(&random) * sum;
    size_t chosen = 0;
    for (size_t i = 0; i < t->sequence_count; i++) {
        if (!starts_of(&t->sequence[i], stage, 0))
            continue;
        chosen = i;
        if (at < t->sequence[i].share)
            break;
        at -= t->sequence[i].share;
    }
    *task = make_task(t, chosen);
    task->unroll = stage->unroll;
    if (drawn >= share)
        task->warm_up =
            (int32_t)((drawn - share) / (1.0 - share) * (warm_up_of(task->sequence, stage) + 1.0));
    while (!starts_of(task->sequence, stage, task->warm_up))
        task->warm_up--;
    task->frame = 1 + (size_t)(ascc_random_uniform(&random) *
                               (double)starts_of(task->sequence, stage, task->warm_up));
    for (int32_t l = 1; l < t->model->plan.level_count; l++)
        edge = fmax(edge, t->model->plan.level[l].voxel);
    task->transform = ascc_rigid_transform_draw(&random, task->sequence, t->options.rotate != 0,
                                                t->options.mirror != 0, edge);
    task->jitter = t->options.jitter * t->model->plan.spacing;
    if (task->sequence->jitter > 0.0)
        task->jitter =
            task->sequence->jitter * ascc_random_uniform(&random) * t->model->plan.spacing;
    task->random = random;
    return ASCC_OK;
}

/* True states as rollouts begin with, drawn apart from all iterations'. */
static ascc_status measure_whitening(ascc_trainer *t)
{
    const ascc_training_stage stage = {.unroll = 1};
    ascc_rollout_task task[ASCC_WHITENING_FRAMES];
    ascc_status status = ASCC_OK;
    for (size_t i = 0; i < ASCC_WHITENING_FRAMES && status == ASCC_OK; i++)
        status = ascc_trainer_draw(t, &stage, ascc_random_open(t->options.seed, UINT64_MAX, i),
                                   &task[i]);
    if (status == ASCC_OK)
        status = ascc_whitening_measure(&t->whitening, &t->worker[0], task, ASCC_WHITENING_FRAMES);
    if (status == ASCC_ERROR_MEMORY)
        FAIL(status, "no memory to whiten the inputs of first layers");
    return status;
}

static void run_tasks(void *data, size_t begin, size_t end, int32_t slot)
{
    ascc_trainer *t = data;
    const size_t weights = t->model->weight_count;
    const size_t packed = t->model->packed.count;
    for (size_t b = begin; b < end; b++)
        t->result[b] =
            ascc_rollout_run(&t->worker[slot], &t->transposed, &t->task[b],
                             t->packed + (size_t)slot * packed, t->gradients + b * weights);
}

/* The step of Adam on the clipped gradient. */
static void adam(ascc_trainer *t, double rate, double norm)
{
    const ascc_trainer_options *o = &t->options;
    const double n = (double)t->iteration + 1.0;
    const double scale = norm > o->clip ? o->clip / norm : 1.0;
    const double correct1 = 1.0 - pow(o->beta1, n), correct2 = 1.0 - pow(o->beta2, n);
    for (size_t k = 0; k < t->parameter_count; k++) {
        const double g = scale * (double)t->gradient[k];
        const double m = o->beta1 * (double)t->moment1[k] + (1.0 - o->beta1) * g;
        const double v = o->beta2 * (double)t->moment2[k] + (1.0 - o->beta2) * g * g;
        t->step[k] = rate * (m / correct1) / (sqrt(v / correct2) + o->epsilon);
        t->moment1[k] = (float)m;
        t->moment2[k] = (float)v;
    }
}

/* Moves the weights and their average by the step; damping stays without negative numbers. */
static void move(ascc_trainer *t)
{
    const double n = (double)t->iteration + 1.0;
    const double keep = fmin(t->options.average, n / (n + 10.0));
    for (size_t i = 0; i < t->tensor_count; i++)
        for (size_t k = t->tensor[i].first; k < t->tensor[i].first + t->tensor[i].count; k++) {
            double w = (double)t->weights[k] - t->step[k];
            if (t->tensor[i].damps && w < 0.0)
                w = 0.0;
            t->weights[k] = (float)w;
            t->average[k] = (float)(keep * (double)t->average[k] + (1.0 - keep) * w);
        }
    for (size_t k = t->learned.first; k < t->parameter_count; k++)
        t->weights[k] = (float)((double)t->weights[k] - t->step[k]);
    ascc_learned_bound(&t->learned, t->weights + t->learned.first);
    for (size_t k = t->learned.first; k < t->parameter_count; k++)
        t->average[k] =
            (float)(keep * (double)t->average[k] + (1.0 - keep) * (double)t->weights[k]);
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static ascc_status sum_up(ascc_trainer *t, ascc_training_report *report)
{
    int32_t counted = 0;
    double square = 0.0;
    for (int32_t b = 0; b < t->batch; b++) {
        const ascc_rollout_result *r = &t->result[b];
        report->steps += r->steps;
        report->ended_early += r->ended_early;
        report->skipped += r->skipped;
        if (r->status != ASCC_OK)
            return rollout_failure(t, &t->task[b], r);
        if (!r->skipped && !isfinite(r->loss))
            return FAIL(ASCC_ERROR_NOT_FINITE, "sequence %s, frame %zu: the loss is not finite",
                        t->task[b].sequence->name, t->task[b].frame);
        if (r->skipped)
            continue;
        report->loss += r->loss;
        counted++;
    }
    memset(t->gradient, 0, t->parameter_count * sizeof *t->gradient);
    for (int32_t b = 0; b < t->batch; b++)
        if (!t->result[b].skipped)
            add_gradient(t, t->gradients + (size_t)b * t->model->weight_count,
                         &t->result[b].constants, 1.0f / (float)counted, t->gradient);
    ascc_whitening_gradient(&t->whitening, t->gradient);
    report->loss /= counted ? counted : 1;
    for (size_t k = 0; k < t->parameter_count; k++)
        square += (double)t->gradient[k] * (double)t->gradient[k];
    report->gradient_norm = sqrt(square);
    if (!isfinite(square))
        return FAIL(ASCC_ERROR_NOT_FINITE,
                    "sequence %s, frame %zu and others: the gradient is not "
                    "finite",
                    t->task[0].sequence->name, t->task[0].frame);
    return ASCC_OK;
}

static void learn(ascc_trainer *t, const ascc_training_report *report)
{
    memcpy(t->before, t->weights, 4 * t->parameter_count * sizeof *t->weights);
    t->before_iteration = t->iteration;
    t->changed = true;
    t->failed_iterations = 0;
    adam(t, report->learning_rate, report->gradient_norm);
    ascc_whitening_step(&t->whitening, t->step);
    move(t);
    ascc_trainer_apply(t);
}

/* Many iterations in a row without any rollout learn nothing: the last change of the weights was one
 * too many, and is taken back. */
static ascc_status count_failed_iterations(ascc_trainer *t)
{
    const ascc_rollout_task *task = &t->task[t->batch - 1];
    const size_t frame = t->result[t->batch - 1].failed_frame;
    if (++t->failed_iterations < MOST_FAILURES)
        return ASCC_OK;
    t->failed_iterations = 0;
    if (!t->changed)
        return FAIL(
            ASCC_ERROR_NOT_FINITE,
            "sequence %s, frame %zu: the step could not be computed, nor any rollout of the "
            "%d iterations before",
            task->sequence->name, frame, MOST_FAILURES - 1);
    memcpy(t->weights, t->before, 4 * t->parameter_count * sizeof *t->weights);
    t->iteration = t->before_iteration;
    t->changed = false;
    ascc_trainer_apply(t);
    return FAIL(ASCC_ERROR_NOT_FINITE,
                "sequence %s, frame %zu: the step could not be computed, nor any rollout of the %d "
                "iterations before; back at iteration %" PRIu64 ", the last with weights that do",
                task->sequence->name, frame, MOST_FAILURES - 1, t->iteration);
}

/* Where all channels of a layer are negative for every particle, nothing behind them is heard of again. */
static ascc_status count_zero_gradients(ascc_trainer *t, const ascc_training_report *report)
{
    t->zero_gradient_count =
        report->gradient_norm == 0.0 && report->loss > 0.0 ? t->zero_gradient_count + 1 : 0;
    if (t->zero_gradient_count < MOST_FAILURES)
        return ASCC_OK;
    t->zero_gradient_count = 0;
    return FAIL(
        ASCC_ERROR_RANGE,
        "the gradient was exactly 0 in the last %d iterations: all channels of a layer are off for "
        "good; go on from an earlier model, with a smaller learning rate",
        MOST_FAILURES);
}

ascc_status ascc_trainer_iterate(ascc_trainer *t, ascc_training_report *report)
{
    ASCC_FLOAT_SCOPE;
    ascc_training_report own = {0};
    if (!ascc_trainer_alive(t))
        return ASCC_ERROR_ARGUMENT;
    if (!report || !ascc_write_struct(report, &own, sizeof own, FIRST_REPORT_SIZE))
        return FAIL(ASCC_ERROR_ARGUMENT, "ascc_training_report.size is not understood");
    const double begin = now();
    const ascc_training_stage *stage = find_stage(t, &own.learning_rate);
    own.unroll = stage->unroll;
    own.warm_up = stage->warm_up;
    ascc_status status = ASCC_OK;
    for (int32_t b = 0; b < t->batch && status == ASCC_OK; b++)
        status = ascc_trainer_draw(
            t, stage, ascc_random_open(t->options.seed, t->iteration, (uint64_t)b), &t->task[b]);
    if (status == ASCC_OK && t->whitening.term_count && !t->whitening.ready)
        status = measure_whitening(t);
    if (status != ASCC_OK)
        return status;
    memset(t->gradients, 0, (size_t)t->batch * t->model->weight_count * sizeof *t->gradients);
    ascc_workers_run(t->shared->workers, (size_t)t->batch, 1, run_tasks, t);
    status = sum_up(t, &own);
    if (status == ASCC_OK) {
        if (own.skipped < t->batch)
            learn(t, &own);
        t->iteration++;
        status =
            own.skipped == t->batch ? count_failed_iterations(t) : count_zero_gradients(t, &own);
    }
    own.iteration = t->iteration;
    own.seconds = now() - begin;
    (void)ascc_write_struct(report, &own, sizeof own, FIRST_REPORT_SIZE);
    return status;
}
