/* SPDX-License-Identifier: Apache-2.0 */
/* Signed distance to a body and its direction. Of constants, see those of the same names in `moving_skin` and `near_body`. */
#ifndef NEURALOCKS_DISTANCE_H
#define NEURALOCKS_DISTANCE_H

#include "body.h"

enum { MOST_NEAR = 8, CLIMBS = 3 };

static const float REACH = 3.2f, BESIDE = 4.0f, THIN = 0.002f, CURVED = 0.004f;

typedef struct {
    int32_t low;
    float place[3];
    int32_t node[3];
} Corner;

/* HeadField._corners: whether the point is in the grid */
static int corner_of(const Body *body, const float point[3], Corner *corner) {
    corner->low = 0;
    for (int x = 0; x < 3; x++) {
        float place = (point[x] - body->head_low[x]) * body->head_per_cell;
        if (!(place >= 0 && place < (float)(body->head_size[x] - 1))) return 0;
        corner->place[x] = place;
        corner->node[x] = (int32_t)place;
        corner->low = corner->low * body->head_size[x] + corner->node[x];
    }
    return 1;
}

/* HeadField.distance */
static int head_distance(const Body *body, const float point[3], float *value, float way[3]) {
    Corner corner;
    if (!corner_of(body, point, &corner)) return 0;
    const int32_t along_x = body->head_size[1] * body->head_size[2], along_y = body->head_size[2];
    double part[3], flat[2][2], line[2], slope_y[2];
    float rise[2][2];
    for (int x = 0; x < 3; x++) part[x] = (double)corner.place[x] - (double)corner.node[x];
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            const float *at = body->head_values + corner.low + i * along_x + j * along_y;
            rise[i][j] = at[1] - at[0];
            flat[i][j] = at[0] + part[2] * rise[i][j];
        }
        slope_y[i] = flat[i][1] - flat[i][0];
        line[i] = flat[i][0] + part[1] * slope_y[i];
    }
    double slope[3] = {line[1] - line[0], 0, 0}, rise_z[2];
    double mixed = line[0] + part[0] * slope[0];
    if (!isfinite(mixed)) return 0;
    for (int i = 0; i < 2; i++) rise_z[i] = rise[i][0] + part[1] * (rise[i][1] - rise[i][0]);
    slope[1] = slope_y[0] + part[0] * (slope_y[1] - slope_y[0]);
    slope[2] = rise_z[0] + part[0] * (rise_z[1] - rise_z[0]);
    double length = sqrt(slope[0] * slope[0] + slope[1] * slope[1] + slope[2] * slope[2]);
    if (!(length > 1e-20f)) length = 1e-20f;
    for (int x = 0; x < 3; x++) way[x] = (float)(slope[x] / length);
    *value = (float)mixed;
    return 1;
}

/* PosedSkin.distance */
static int skin_distance(const Body *body, const float point[3], int32_t cell, float head, float *value, float way[3]) {
    const int count = body->neighbours;
    const int32_t *near = 0;
    float off[MOST_NEAR][3], squared[MOST_NEAR];
    int32_t sample = body->start[cell];
    int best = 0;
    for (int climb = 0; climb < CLIMBS; climb++) {
        near = body->near + (int64_t)sample * count;
        best = 0;
        for (int k = 0; k < count; k++) {
            const float *plane = body->planes + (int64_t)near[k] * 6;
            for (int x = 0; x < 3; x++) off[k][x] = point[x] - plane[x];
            squared[k] = off[k][0] * off[k][0] + off[k][1] * off[k][1] + off[k][2] * off[k][2];
            if (squared[k] < squared[best]) best = k;
        }
        sample = near[best];
        if (!best) break;
    }
    const int32_t first = near[0];
    const float nearest = squared[best], square = body->square[first];
    const float *counted = body->counted + (int64_t)first * count;
    float height = 0, weights = 0, mean[3] = {0, 0, 0};
    for (int k = 0; k < count; k++) {
        const float *normal = body->planes + (int64_t)near[k] * 6 + 3;
        float weight = 1 - (squared[k] - nearest) / (REACH * square);
        if (!(weight > 0)) weight = 0;
        weight *= weight;
        weight *= counted[k];
        weights += weight;
        height += (off[k][0] * normal[0] + off[k][1] * normal[1] + off[k][2] * normal[2]) * weight;
        for (int x = 0; x < 3; x++) mean[x] += normal[x] * weight;
    }
    height /= weights;
    if (nearest - height * height > BESIDE * square || nearest - 0.5f * square > head * head ||
        -height > body->thick[first] + THIN)
        return 0;
    float length = sqrtf(mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2]);
    if (!(length > 1e-20f)) length = 1e-20f;
    for (int x = 0; x < 3; x++) way[x] = mean[x] / length;
    *value = height;
    return isfinite(height);
}

/* PosedBody.distance */
static inline float distance_in(const Body *body, const float point[3], int32_t cell, float way[3]) {
    const uint8_t mark = body->marks[cell];
    float value = INFINITY, other, direction[3];
    way[0] = way[1] = way[2] = 0;
    if (mark & HEAD && head_distance(body, point, &other, direction)) {
        value = other;
        memcpy(way, direction, sizeof direction);
    }
    if (body->start && mark & SKIN && skin_distance(body, point, cell, value, &other, direction)) {
        value = other;
        memcpy(way, direction, sizeof direction);
    }
    return value;
}

/* PosedBody.violated, one vertex */
static inline int too_near(const Body *body, const float point[3], float low) {
    const int32_t cell = cell_of(&body->box, point);
    const uint8_t mark = body->marks[cell];
    float way[3];
    int close = 0;
    if (!mark) return 0;
    if (mark & HEAD) {
        Corner corner;
        if (corner_of(body, point, &corner)) {
            int32_t at = 0;
            for (int x = 0; x < 3; x++)
                at = at * body->head_size[x] + corner.node[x] + ((double)corner.place[x] - (double)corner.node[x] > 0.5);
            close = body->head_values[at] < low + body->head_close;
        }
    }
    if (body->start && mark & SKIN) {
        const float *plane = body->planes + (int64_t)body->start[cell] * 6;
        float a = (point[0] - plane[0]) * plane[3], b = (point[1] - plane[1]) * plane[4];
        close |= a + b + (point[2] - plane[2]) * plane[5] < low + CURVED;
    }
    return close && distance_in(body, point, cell, way) < low;
}

#endif
