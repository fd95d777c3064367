/* SPDX-License-Identifier: Apache-2.0 */
/* Hair kept out of a body, strand by strand: what `laying.keep_out` and `laying.resolved` compute. */
#include "distance.h"

enum { TRIES = 2, NEVER = 0, ALWAYS = 2 };

/* Of `laying`. */
static const float SLACK = 1e-5f;
static const double MARGIN = 0.001, FLAT = 0.004, BACK = 0.3, UNSEEN = 0.012, STEEP = 0.003;

typedef struct {
    double height, way[3];
} Plane;

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static double size(const double a[3]) { return sqrt(dot(a, a)); }
static double least_of(double a, double b) { return a < b ? a : b; }
static double most_of(double a, double b) { return a > b ? a : b; }
static void between(const double a[3], const double b[3], double out[3]) {
    for (int x = 0; x < 3; x++) out[x] = b[x] - a[x];
}

static Plane plane_at(const Body *body, const double point[3]) {
    float place[3] = {(float)point[0], (float)point[1], (float)point[2]}, way[3];
    Plane plane = {distance_in(body, place, cell_of(&body->box, place), way), {0, 0, 0}};
    for (int x = 0; x < 3; x++) plane.way[x] = way[x];
    return plane;
}

/* going_in._go_on, in one direction */
static void go_on(double points[K][3], Plane planes[K], int first, int step) {
    for (int n = 1, i = first + step; n < K; n++, i += step) {
        const Plane *before = &planes[i - step];
        if (!(isinf(planes[i].height) && before->height < 0)) continue;
        double way[3];
        between(points[i - step], points[i], way);
        double lower = before->height + dot(before->way, way);
        if (!(lower < 0)) continue;
        planes[i] = *before;
        planes[i].height = lower;
    }
}

/* laying._measured */
static void measure(const Body *body, double points[K][3], Plane planes[K]) {
    Plane back[K];
    int deep = 0;
    for (int i = 0; i < K; i++) planes[i] = plane_at(body, points[i]);
    for (int i = 1; i < K; i++)
        deep |= (isinf(planes[i].height) && planes[i - 1].height < 0) || (isinf(planes[i - 1].height) && planes[i].height < 0);
    if (!deep) return;
    memcpy(back, planes, sizeof back);
    go_on(points, planes, 0, 1);
    go_on(points, back, K - 1, -1);
    for (int i = 0; i < K; i++)
        if (isinf(planes[i].height) || (isfinite(back[i].height) && back[i].height > planes[i].height)) planes[i] = back[i];
}

/* laying._aimed */
static void aim(const double edge[3], const double off[3], double length, double out[3]) {
    const double most = BACK * length, share = most / sqrt(dot(off, off) + most * most + 1e-30);
    for (int x = 0; x < 3; x++) out[x] = edge[x] + off[x] * share;
    const double scale = length / most_of(size(out), 1e-12);
    for (int x = 0; x < 3; x++) out[x] *= scale;
}

/* laying._supposed */
static Plane suppose(const Plane *first, const double step[3], double second, const double other[3], const double far[3]) {
    const double height = first->height < 2 * MARGIN ? first->height + dot(first->way, step) : INFINITY;
    const double nearer = second < 0 ? second + dot(other, far) : -INFINITY;
    Plane plane = {most_of(height, nearer), {0, 0, 0}};
    memcpy(plane.way, nearer > height ? other : first->way, sizeof plane.way);
    return plane;
}

/* laying._tilted: how much it lifts */
static double tilt(const double along[3], const double up[3], double lack, double length, double out[3]) {
    const double rise = dot(along, up), slope = most_of(-length, least_of(rise + lack, length));
    for (int x = 0; x < 3; x++) out[x] = along[x] - rise * up[x] + 1e-9 * up[(x + 1) % 3];
    const double still = dot(out, up);
    for (int x = 0; x < 3; x++) out[x] -= still * up[x];
    const double scale = sqrt(length * length - slope * slope) / most_of(size(out), 1e-30);
    for (int x = 0; x < 3; x++) out[x] = out[x] * scale + slope * up[x];
    return slope - rise;
}

/* One vertex of laying._laid, from the vertex before it on: whether it may still be inside */
static int lay_vertex(const Body *body, double wanted[K][3], const float keep[K], Plane planes[K], double result[K][3], int i,
                      int *moved) {
    double edge[3], off[3], end[3], along[3], tilted[3];
    between(wanted[i - 1], wanted[i], edge);
    const double *before = result[i - 1], length = size(edge);
    memcpy(end, wanted[i], sizeof end);
    if (*moved) {
        between(before, wanted[i - 1], off);
        aim(edge, off, length, end);
        for (int x = 0; x < 3; x++) end[x] = before[x] + end[x];
    }
    between(wanted[i], end, off);
    const double known = isinf(planes[i].height) ? UNSEEN : planes[i].height;
    const int near = known - 1.2 * size(off) < keep[i];
    const Plane there = planes[i];
    if (*moved) planes[i].height = INFINITY;
    const double least = least_of(planes[i - 1].height, 0) - 1.1 * length - STEEP;
    int open = near;
    for (int tried = 0; open && tried < TRIES; tried++) {
        if (*moved) planes[i] = plane_at(body, end);
        between(before, end, along);
        if (isinf(planes[i].height) || planes[i].height < least) {
            between(wanted[i], end, off);
            planes[i] = suppose(&planes[i - 1], along, there.height < least ? 0 : there.height, there.way, off);
        }
        if (!(planes[i].height < keep[i] - (tried ? 0.1 * MARGIN : (double)SLACK))) {
            open = 0;
            break;
        }
        *moved = 1;
        const double lack = keep[i] + 4e-5 - planes[i].height;
        const double gained = tilt(along, planes[i].way, lack, length, tilted);
        between(along, tilted, off);
        for (int x = 0; x < 3; x++) end[x] = before[x] + tilted[x];
        planes[i].height += gained;
        open = size(off) > FLAT || gained < lack - 1e-6;
    }
    memcpy(result[i], end, sizeof end);
    return open;
}

/* One strand of laying.resolved, in place. */
static void lay(const Body *body, float points[K][3], const float keep[K]) {
    double wanted[K][3], result[K][3], lack = -INFINITY;
    Plane planes[K];
    int first = K, moved = 0, hard = 0;
    for (int i = 0; i < K; i++)
        for (int x = 0; x < 3; x++) wanted[i][x] = points[i][x];
    measure(body, wanted, planes);
    for (int i = 0; i < K; i++) {
        lack = most_of(lack, keep[i] - planes[i].height);
        if (first == K && keep[i] - planes[i].height > SLACK) first = i;
    }
    if (first == K) return;
    memcpy(result, wanted, sizeof result);
    for (int i = first > 0 ? first : 1; i < K; i++) hard |= lay_vertex(body, wanted, keep, planes, result, i, &moved);
    if (hard) {
        double left = -INFINITY;
        measure(body, result, planes);
        for (int i = 0; i < K; i++) left = most_of(left, keep[i] - planes[i].height);
        if (left > most_of(lack, 0.5 * MARGIN)) return;
    }
    for (int i = 0; i < K; i++)
        for (int x = 0; x < 3; x++) points[i][x] = (float)result[i][x];
}

/* laying.resolved: strands (n, K, 3), in place; `keep` (n, K) */
PUBLIC void neuralocks_lay(const Body *body, float *strands, const float *keep, int64_t n) {
    for (int64_t s = 0; s < n; s++) lay(body, (float(*)[3])(strands + s * K * 3), keep + s * K);
}

/* laying.keep_out: displacement (n, K, 3), in place; `watch` (n): NEVER, CHECKED or ALWAYS */
PUBLIC void neuralocks_keep_out(const Body *body, const float *rest, float *displacement, const float *keep, const uint8_t *watch,
                                int64_t n) {
    for (int64_t s = 0; s < n; s++, rest += K * 3, displacement += K * 3, keep += K) {
        float points[K][3];
        if (watch[s] == NEVER) continue;
        for (int i = 0; i < K * 3; i++) points[i / 3][i % 3] = rest[i] + displacement[i];
        int hit = watch[s] == ALWAYS;
        for (int i = 0; i < K && !hit; i++) hit = too_near(body, points[i], keep[i] - SLACK);
        if (!hit) continue;
        lay(body, points, keep);
        for (int i = 0; i < K * 3; i++) displacement[i] = points[i / 3][i % 3] - rest[i];
    }
}
