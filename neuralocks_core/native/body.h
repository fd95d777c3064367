/* SPDX-License-Identifier: Apache-2.0 */
/* One body in one pose, as `near_body.PosedBody` holds it. */
#ifndef NEURALOCKS_BODY_H
#define NEURALOCKS_BODY_H

#include "platform.h"

enum { HEAD = 1, SKIN = 2 }; /* bits of marks */

/* moving_skin.Box */
typedef struct {
    float low[3], per_cell;
    int32_t strides[3], count;
} Box;

/* Arrays are C-contiguous and as in Python. */
typedef struct {
    Box box;
    const uint8_t *marks; /* (cells) */
    /* head_field.HeadField */
    float head_low[3], head_per_cell, head_close;
    int32_t head_size[3];
    const float *head_values;
    /* moving_skin.PosedSkin; no skin moves if `start` is null */
    const int32_t *start, *near; /* (cells), (samples, neighbours) */
    const float *planes;         /* (samples, 6): place and normal */
    const float *square, *thick; /* (samples) */
    const float *counted;        /* (samples, neighbours) */
    int32_t neighbours;
} Body;

/* Box.cells */
static inline int32_t cell_of(const Box *box, const float point[3]) {
    uint32_t cell = 0; /* wraps as numpy's integers do */
    for (int x = 0; x < 3; x++) {
        float place = (point[x] - box->low[x]) * box->per_cell;
        if (!(fabsf(place) < 2e9f)) return 0;
        cell += (uint32_t)(int32_t)place * (uint32_t)box->strides[x];
    }
    int32_t index = (int32_t)cell;
    if (index < 0) return 0;
    return index < box->count ? index : box->count - 1;
}

#endif
