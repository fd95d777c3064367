/* SPDX-License-Identifier: Apache-2.0 */
/* What all C files here share.
 *
 * Python's functions are the description, with the reasons; the C files do the same operations in the same order and precision, so
 * that both give the same bits. They must be compiled without contraction of products and sums. Nothing is allocated.
 */
#ifndef NEURALOCKS_PLATFORM_H
#define NEURALOCKS_PLATFORM_H

#include <stdint.h>

/* The compilers' own, so that the library needs no other. */
#define sqrt __builtin_sqrt
#define sqrtf __builtin_sqrtf
#define fabsf __builtin_fabsf
#define isinf __builtin_isinf
#define isfinite __builtin_isfinite
#define INFINITY __builtin_inff()
#define memcpy __builtin_memcpy
#define memset __builtin_memset

#if defined(_WIN32)
#define PUBLIC __declspec(dllexport)
#else
#define PUBLIC __attribute__((visibility("default")))
#endif

enum { K = 24 }; /* the network's vertices on a strand */

#endif
