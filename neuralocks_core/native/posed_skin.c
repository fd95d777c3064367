/* SPDX-License-Identifier: Apache-2.0 */
/* Samples of moving skin posed and entered in a grid: what `moving_skin.PosedSkin` does when it is made. */
#include "body.h"

enum { DEPTH = 3, LAYOUT = 1 };

/* moving_skin._planes, of one sample */
static void pose(const float *points, const int32_t corners[3], const float part[2], float plane[6]) {
    const float *a = points + 3 * (int64_t)corners[0];
    float b[3], c[3], *normal = plane + 3;
    for (int x = 0; x < 3; x++) {
        b[x] = points[3 * (int64_t)corners[1] + x] - a[x];
        c[x] = points[3 * (int64_t)corners[2] + x] - a[x];
    }
    for (int x = 0; x < 3; x++) {
        const int y = (x + 1) % 3, z = (x + 2) % 3;
        normal[x] = b[y] * c[z] - b[z] * c[y];
    }
    float length = sqrtf(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    if (!(length > 1e-20f)) length = 1e-20f;
    for (int x = 0; x < 3; x++) {
        normal[x] /= length;
        plane[x] = a[x] + b[x] * part[0] + c[x] * part[1];
    }
}

/* A number that changes with this library's interface, for whoever loads it to compare. */
PUBLIC int32_t neuralocks_layout(void) { return 1000 * LAYOUT + (int32_t)sizeof(Body); }

/* Planes (n, 6) of samples on triangles (n, 3) of points (V, 3), at `part` (n, 2) of each, and the grid's `start` and `marks` (cells).
 *
 * box, cell: the grid, and the width of its cells; low, high: where samples must lie to be entered; own: (2, n), for use here.
 */
PUBLIC void neuralocks_pose_skin(const Box *box, double cell, const float low[3], const float high[3], const float *points,
                                 const int32_t *corners, const float *part, int64_t n, int32_t *own, float *planes, int32_t *start,
                                 uint8_t *marks) {
    for (int64_t i = 0; i < n; i++) {
        float *place = planes + 6 * i;
        pose(points, corners + 3 * i, part + 2 * i, place);
        int held = 1;
        for (int x = 0; x < 3; x++) held &= place[x] > low[x] && place[x] < high[x];
        own[i] = held ? cell_of(box, place) : -1;
    }
    /* From the farthest cells to a sample's own: the last one entered is the nearest. */
    for (int depth = DEPTH; depth > 0; depth--) {
        const float down = (float)(depth * cell);
        for (int64_t i = 0; i < n; i++) {
            if (own[i] < 0) continue;
            const float *plane = planes + 6 * i;
            const float place[3] = {plane[0] - plane[3] * down, plane[1] - plane[4] * down, plane[2] - plane[5] * down};
            const int32_t below = cell_of(box, place);
            start[below] = (int32_t)i;
            marks[below] |= SKIN;
        }
    }
    /* Around them, of samples in one cell the last one stands for all. */
    for (int64_t i = 0; i < n; i++)
        if (own[i] >= 0) start[own[i]] = (int32_t)i;
    int64_t left = 0;
    int32_t *sample = own + n;
    for (int64_t i = 0; i < n; i++)
        if (own[i] >= 0 && start[own[i]] == (int32_t)i) {
            own[left] = own[i];
            sample[left++] = (int32_t)i;
        }
    for (int far = 3; far >= 0; far--)
        for (int32_t step = 0; step < 27; step++) {
            const int32_t x = step / 9 - 1, y = step / 3 % 3 - 1, z = step % 3 - 1;
            if (x * x + y * y + z * z != far) continue;
            const int32_t on = x * box->strides[0] + y * box->strides[1] + z * box->strides[2];
            for (int64_t i = 0; i < left; i++) {
                start[own[i] + on] = sample[i];
                marks[own[i] + on] |= SKIN;
            }
        }
}
