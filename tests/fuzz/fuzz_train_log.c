/* Goes on with a training log made of any bytes: what is kept of it is kept again.
 * SPDX-License-Identifier: MIT
 *
 * The first byte is the iteration to go on from; if the second is 'h', the log's own heading comes before the rest.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fuzz.h"
#include "train_log.h"

static bool same(double a, double b)
{
    return (isnan(a) && isnan(b)) || a == b;
}

static bool same_validation(const ascc_validation *a, const ascc_validation *b)
{
    return a->measured == b->measured && a->stable == b->stable && same(a->error[0], b->error[0]) &&
           same(a->error[1], b->error[1]) && same(a->last_frame, b->last_frame) &&
           same(a->escaped, b->escaped) && same(a->density_error, b->density_error);
}

static void resume(const char *path, uint64_t iteration)
{
    ascc_train_log log, again;
    char error[512] = "";
    if (!ascc_train_log_open(path, iteration, &log, error, sizeof error)) {
        fuzz_require(error[0] != '\0' && log.file == NULL);
        return;
    }
    const double seconds = log.seconds;
    const ascc_validation last = log.last, best = log.best;
    ascc_train_log_close(&log);

    fuzz_require(ascc_train_log_open(path, iteration, &again, error, sizeof error));
    fuzz_require(same(again.seconds, seconds));
    fuzz_require(same_validation(&again.last, &last) && same_validation(&again.best, &best));
    const ascc_training_report report = {
        .size = sizeof report, .iteration = iteration + 1, .loss = 0.5};
    const ascc_validation worse = {.measured = true, .error = {1.0, 2.0}};
    fuzz_require(ascc_train_log_add(&again, 1, &report, 1.0, &worse));
    ascc_train_log_close(&again);

    fuzz_require(ascc_train_log_open(path, iteration + 1, &log, error, sizeof error));
    fuzz_require(log.last.measured && log.last.error[1] == 2.0 && !log.last.stable);
    ascc_train_log_close(&log);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char heading[] =
        "iteration,stage,unroll,warm_up,learning_rate,loss,gradient_norm,seconds,steps,"
        "ended_early,skipped,err_n1,err_n2,rollout_last,escaped,density_error,stable\n";
    if (size < 2)
        return 0;
    const bool headed = data[1] == 'h';
    const size_t before = headed ? sizeof heading - 1 : 0, rest = size - 2;
    char *text = malloc(before + rest + 1);
    fuzz_require(text != NULL);
    memcpy(text, heading, before);
    memcpy(text + before, data + 2, rest);
    resume(fuzz_file("log.csv", text, before + rest), data[0]);
    free(text);
    return 0;
}
