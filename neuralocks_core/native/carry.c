/* SPDX-License-Identifier: Apache-2.0 */
/* A groom's own vertices moved as the network's are, strand by strand: what `carrier.Carrier.carry` computes. */
#include "platform.h"

enum { NODES = 4 };

/* Of `lengths`. */
static const float TINY = 1e-24f;

/* carrier.Carrier and following.Following. Arrays are C-contiguous. */
typedef struct {
    const int64_t *ends;   /* (S + 1) */
    const float *points;   /* (P, 3) */
    const uint8_t *still;  /* (S) */
    const float *facing;   /* (3, 3), or null if axes are the same */
    const uint8_t *first;  /* (P), or null if own vertices are the network's */
    const float *weights;  /* (P, NODES) */
    const int32_t *coil;   /* (S): which of F coils a strand is, or -1 */
    const float *edges;    /* (F, K - 1, 3) */
    const int64_t *begin;  /* (F): a coil's first vertex among those of all */
    const uint8_t *segment;
    const float *share, *beside; /* (P of coils), and (, 3) */
} Groom;

/* carrier.Placing */
typedef struct {
    float linear[3][3], centre[3], origin[3];
} Placing;

static float dot(const float a[3], const float b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const float a[3], const float b[3], float out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static float squared(const float q[4]) { return q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]; }

/* following.means */
static void mean(const Groom *groom, float network[K][3], int64_t begin, int64_t count, float *moved) {
    for (int64_t p = 0; p < count; p++) {
        const float *at = network[groom->first[begin + p]], *weight = groom->weights + NODES * (begin + p);
        for (int x = 0; x < 3; x++)
            moved[3 * p + x] = at[x] * weight[0] + at[3 + x] * weight[1] + at[6 + x] * weight[2] + at[9 + x] * weight[3];
    }
}

/* turning._turns */
static void turn(const float *edges, float network[K][3], float turns[K][4]) {
    float segment[K - 1][4];
    for (int i = 0; i < K - 1; i++) {
        const float *edge = edges + 3 * i;
        float now[3];
        for (int x = 0; x < 3; x++) now[x] = edge[x] + (network[i + 1][x] - network[i][x]);
        cross(edge, now, segment[i]);
        segment[i][3] = sqrtf(dot(edge, edge) * dot(now, now)) + dot(edge, now);
        float square = squared(segment[i]);
        const float size = sqrtf(square > 1e-30f ? square : 1e-30f);
        for (int x = 0; x < 4; x++) segment[i][x] /= size;
    }
    memcpy(turns[0], segment[0], sizeof turns[0]);
    memcpy(turns[K - 1], segment[K - 2], sizeof turns[0]);
    for (int i = 1; i < K - 1; i++)
        for (int x = 0; x < 4; x++) turns[i][x] = (segment[i - 1][x] + segment[i][x]) * 0.5f;
}

/* turning.turned */
static void wind(const Groom *groom, int32_t coil, float network[K][3], int64_t count, float *moved) {
    float turns[K][4];
    turn(groom->edges + (int64_t)coil * (K - 1) * 3, network, turns);
    for (int64_t p = 0; p < count; p++) {
        const int64_t own = groom->begin[coil] + p;
        const int i = groom->segment[own];
        const float share = groom->share[own], *beside = groom->beside + 3 * own;
        float q[4], once[3], twice[3];
        for (int x = 0; x < 4; x++) q[x] = turns[i][x] + share * (turns[i + 1][x] - turns[i][x]);
        cross(q, beside, once);
        cross(q, once, twice);
        const float square = squared(q), scale = 2.0f / (square > 1e-12f ? square : 1e-12f);
        for (int x = 0; x < 3; x++) {
            const float line = network[i][x] + share * (network[i + 1][x] - network[i][x]);
            moved[3 * p + x] = line + (twice[x] + once[x] * q[3]) * scale;
        }
    }
}

/* lengths.keep_lengths; work: (5, count) */
static void keep_lengths(const float *points, int64_t count, int smooth, float *moved, float *work) {
    float *edges = work, *lengths = work + 3 * count, *squares = work + 4 * count;
    float drift[3] = {0, 0, 0}, last[3] = {0, 0, 0}, total[3];
    for (int64_t i = 0; i + 1 < count; i++) {
        float before[3], *edge = edges + 3 * i;
        for (int x = 0; x < 3; x++) {
            before[x] = points[3 * i + 3 + x] - points[3 * i + x];
            edge[x] = (moved[3 * i + 3 + x] - moved[3 * i + x]) + before[x];
        }
        lengths[i] = dot(before, before);
        squares[i] = dot(edge, edge) + TINY;
    }
    memcpy(total, moved, sizeof total);
    for (int64_t i = 0; i + 1 < count; i++) {
        float edge[3], along = 0;
        memcpy(edge, edges + 3 * i, sizeof edge);
        if (smooth) {
            const float scale = sqrtf(lengths[i] / squares[i]) - 1.0f;
            for (int x = 0; x < 3; x++) drift[x] += edge[x] * scale;
            along = dot(drift, edge) / squares[i];
            for (int x = 0; x < 3; x++) {
                const float other = edge[x] * along;
                edge[x] = (edge[x] + other) - last[x];
                last[x] = other;
            }
        }
        const float scale = sqrtf(lengths[i] / (dot(edge, edge) + TINY));
        for (int x = 0; x < 3; x++) {
            total[x] += edge[x] * scale - (points[3 * i + 3 + x] - points[3 * i + x]);
            moved[3 * i + 3 + x] = total[x];
        }
    }
}

/* The end of Carrier._carried */
static void place(const Placing *placing, const float *points, const float *onto, const float *moved, int64_t count, float *out) {
    for (int64_t p = 0; p < 3 * count; p += 3) {
        float by[3];
        memcpy(by, moved + p, sizeof by);
        if (placing) {
            float from[3];
            for (int x = 0; x < 3; x++) from[x] = onto ? moved[p + x] : (points[p + x] - placing->centre[x]) + moved[p + x];
            for (int x = 0; x < 3; x++) by[x] = dot(placing->linear[x], from);
        }
        for (int x = 0; x < 3; x++)
            if (!onto)
                out[p + x] = by[x] + placing->origin[x];
            else /* -0 + 0 would be +0 */
                out[p + x] = by[x] == 0 ? onto[p + x] : onto[p + x] + by[x];
    }
}

/* Points of strands from `start` to `stop`: displacement (stop - start, K, 3), onto and out (their points, 3), work (8, most points of
 * a strand). `onto` or `placing` may be null, not both.
 */
PUBLIC void neuralocks_carry(const Groom *groom, const float *displacement, int64_t start, int64_t stop, const Placing *placing,
                             const float *onto, float *out, float *work) {
    const int64_t from = groom->ends[start];
    for (int64_t s = start; s < stop; s++) {
        const int64_t begin = groom->ends[s], count = groom->ends[s + 1] - begin;
        const float *given = displacement + (s - start) * K * 3, *points = groom->points + 3 * begin;
        float network[K][3], *moved = work;
        if (!count) continue;
        memcpy(network, given, sizeof network);
        if (groom->still[s]) memset(network, 0, sizeof network);
        if (groom->facing)
            for (int i = 0; i < K; i++) {
                const float d[3] = {network[i][0], network[i][1], network[i][2]};
                for (int x = 0; x < 3; x++)
                    network[i][x] = d[0] * groom->facing[x] + d[1] * groom->facing[3 + x] + d[2] * groom->facing[6 + x];
            }
        if (!groom->first)
            moved = network[0];
        else {
            const int coil = groom->coil[s];
            if (coil < 0)
                mean(groom, network, begin, count, moved);
            else
                wind(groom, coil, network, count, moved);
            keep_lengths(points, count, coil < 0, moved, work + 3 * count);
        }
        place(placing, points, onto ? onto + 3 * (begin - from) : 0, moved, count, out + 3 * (begin - from));
    }
}
