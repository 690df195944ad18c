/* Saves the demonstration model as a file: save_demo 2|3 FILE. SPDX-License-Identifier: MIT */
#include <stdlib.h>

#include <ascc/ascc.h>

#include "../../examples/demo_model.h"

int main(int argc, char **argv)
{
    if (argc != 3)
        return 2;
    size_t size;
    unsigned char *bytes = demo_model_bytes(atoi(argv[1]), 0.05, &size);
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    const int good = bytes && ascc_context_create(NULL, &context) == ASCC_OK &&
                     ascc_model_load_memory(context, bytes, size, &model) == ASCC_OK &&
                     ascc_model_save(model, argv[2]) == ASCC_OK;
    free(bytes);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return good ? 0 : 1;
}
