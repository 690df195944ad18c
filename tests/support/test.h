/* What every test program includes: cmocka, with the headers it wants before it.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TEST_H
#define ASCC_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <ascc/ascc.h>

#define COUNT_OF(array) (sizeof(array) / sizeof *(array))

#endif
