/* The version of these headers. SPDX-License-Identifier: MIT */
#ifndef ASCC_VERSION_H
#define ASCC_VERSION_H

/* Within one major number the ABI only grows: a program built against 1.x runs with any later 1.y. */
#define ASCC_VERSION_MAJOR 0
#define ASCC_VERSION_MINOR 1
#define ASCC_VERSION_PATCH 0

#endif
