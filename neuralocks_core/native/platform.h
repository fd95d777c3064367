/* SPDX-License-Identifier: Apache-2.0 */
/* What all C files here share.
 *
 * Python's functions are the description, with the reasons; the C files do the same operations in the same order and precision, so
 * that both give the same bits. They must be compiled without contraction of products and sums. Nothing is allocated.
 */
#ifndef NEURALOCKS_PLATFORM_H
#define NEURALOCKS_PLATFORM_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(_WIN32)
#define PUBLIC __declspec(dllexport)
#else
#define PUBLIC __attribute__((visibility("default")))
#endif

enum { K = 24 }; /* the network's vertices on a strand */

#endif
