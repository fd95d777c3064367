# SPDX-License-Identifier: Apache-2.0
"""Cost of rigged mesh hair per avatar: this network in C and in Python, VRM spring bones in C, in one run.

    python benchmarks/rig_speed.py [--joints 16] [--json]

Every evaluation has different inputs. C programs are built with gcc; times are the best of 300 runs of 4,096 evaluations
(1.2 million in all), so that other work on the machine does not count. It takes some seconds.
"""

import argparse
import json
import os
import subprocess
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from neuralocks_core.character import Character, Skeleton
from neuralocks_core.rig import RigModel, find_chains, rig_spec
from neuralocks_core.rig.export_c import export_c
from neuralocks_core.rig.graph import rig_graph
from neuralocks_core.rig.network import feature_columns, input_limits

TIMING = """#define _POSIX_C_SOURCE 199309L
#include "hair.h"
#include <stdio.h>
#include <time.h>
#define SETS 1024
static nl_hair_input in[SETS];
static nl_hair_output out;
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec; }
int main(void) {
  unsigned int s = 1; int i, j, run; double best = 1e9; volatile float sink = 0.0f;
  for (i = 0; i < SETS; ++i) {
    float *p = (float *)&in[i];
    for (j = 0; j < (int)(sizeof in[0] / sizeof(float)); ++j) { s = s * 1664525u + 1013904223u; p[j] = (float)(s >> 8) / 8388608.0f - 1.0f; }
  }
  for (run = 0; run < 300; ++run) {
    double t = now();
    for (i = 0; i < 4096; ++i) { nl_hair_evaluate(&in[i & (SETS - 1)], &out); sink += out.turn[i & 7][1]; }
    t = (now() - t) / 4096.0; if (t < best) best = t;
  }
  printf("%.6f\\n", 1e6 * best);
  return sink > 1e30f;
}
"""
SPRING = """#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stdio.h>
#include <time.h>
#define N @JOINTS@
typedef struct { float x, y, z; } V;
typedef struct { float w, x, y, z; } Q;
static const int parent[N] = {@PARENTS@};
static const V way[N] = {@WAY@}, axis[N] = {@AXIS@};
static const float length[N] = {@LENGTH@};
static V tail[N], prev[N]; static Q turn[N], world[N]; static V place[N];
static V rot(Q q, V v) {
  V t = {2 * (q.y * v.z - q.z * v.y), 2 * (q.z * v.x - q.x * v.z), 2 * (q.x * v.y - q.y * v.x)};
  V r = {v.x + q.w * t.x + q.y * t.z - q.z * t.y, v.y + q.w * t.y + q.z * t.x - q.x * t.z, v.z + q.w * t.z + q.x * t.y - q.y * t.x};
  return r;
}
static Q mul(Q a, Q b) {
  Q r = {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
         a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
  return r;
}
static const V sphere = {0.0f, 0.05f, 0.0f};
static void update(Q head, V at, float dt) {
  int i;
  V c = rot(head, sphere); c.x += at.x; c.y += at.y; c.z += at.z;
  for (i = 0; i < N; ++i) {
    Q up = parent[i] < 0 ? head : world[parent[i]]; V o = parent[i] < 0 ? at : place[parent[i]], w = rot(up, way[i]), a = rot(up, axis[i]), n, l;
    float r, d; Q q, conj = {up.w, -up.x, -up.y, -up.z};
    o.x += w.x; o.y += w.y; o.z += w.z; place[i] = o;
    n.x = tail[i].x + (tail[i].x - prev[i].x) * 0.6f + a.x * dt; n.y = tail[i].y + (tail[i].y - prev[i].y) * 0.6f + a.y * dt;
    n.z = tail[i].z + (tail[i].z - prev[i].z) * 0.6f + a.z * dt;
    l.x = n.x - o.x; l.y = n.y - o.y; l.z = n.z - o.z; r = length[i] / sqrtf(l.x * l.x + l.y * l.y + l.z * l.z + 1e-12f);
    n.x = o.x + l.x * r; n.y = o.y + l.y * r; n.z = o.z + l.z * r;
    l.x = n.x - c.x; l.y = n.y - c.y; l.z = n.z - c.z; d = sqrtf(l.x * l.x + l.y * l.y + l.z * l.z);
    if (d < 0.1f) {
      r = 0.1f / (d + 1e-9f); n.x = c.x + l.x * r; n.y = c.y + l.y * r; n.z = c.z + l.z * r;
      l.x = n.x - o.x; l.y = n.y - o.y; l.z = n.z - o.z; r = length[i] / sqrtf(l.x * l.x + l.y * l.y + l.z * l.z + 1e-12f);
      n.x = o.x + l.x * r; n.y = o.y + l.y * r; n.z = o.z + l.z * r;
    }
    prev[i] = tail[i]; tail[i] = n;
    l.x = (n.x - o.x) / length[i]; l.y = (n.y - o.y) / length[i]; l.z = (n.z - o.z) / length[i];
    l = rot(conj, l); a = axis[i];
    q.w = 1 + a.x * l.x + a.y * l.y + a.z * l.z; q.x = a.y * l.z - a.z * l.y; q.y = a.z * l.x - a.x * l.z; q.z = a.x * l.y - a.y * l.x;
    r = 1 / sqrtf(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z + 1e-12f); q.w *= r; q.x *= r; q.y *= r; q.z *= r;
    turn[i] = q; world[i] = mul(up, q);
  }
}
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec; }
int main(void) {
  static Q heads[1024]; static V places[1024]; int i, run; double best = 1e9; volatile float sink = 0;
  for (i = 0; i < 1024; ++i) {
    float a = 0.3f * sinf(0.0061359f * (float)i * 7.0f); heads[i].w = cosf(a); heads[i].x = sinf(a); heads[i].y = heads[i].z = 0;
    places[i].x = 0.1f * sinf(0.0061359f * (float)i * 3.0f); places[i].y = 1.6f; places[i].z = 0;
  }
  for (run = 0; run < 300; ++run) {
    double t = now();
    for (i = 0; i < 4096; ++i) { update(heads[i & 1023], places[i & 1023], 1.0f / 60.0f); sink += turn[i & 7].x; }
    t = (now() - t) / 4096.0; if (t < best) best = t;
  }
  printf("%.6f\\n", 1e6 * best);
  return sink > 1e30f;
}
"""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--joints", type=int, default=16, help="in chains of four")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, dynamic, hidden in (("quasi-static, 2 x 16", False, 16), ("dynamic, 2 x 32", True, 32)):
            model = _model(max(1, options.joints // 4), hidden, dynamic)
            export_c(model, Path(folder) / "hair.h")
            for flags in ("-O2", "-O3 -march=native"):
                rows[f"C, {name}, {flags}"] = _c(folder, TIMING, flags)
            rows |= {f"{k}, {name}": v for k, v in _python(model).items()}
        for flags in ("-O2", "-O3 -march=native"):
            rows[f"C, VRM spring bones with one collider, {flags}"] = _c(folder, _spring(model), flags)
    if options.json:
        print(json.dumps(rows, indent=1))
        return
    print(f"{len(model.chains)} hair joints, microseconds per avatar and evaluation, one thread")
    for name, value in rows.items():
        print(f"  {name:72s} {value:8.3f}")


def _model(chains: int, hidden: int, dynamic: bool) -> RigModel:
    """Chains of four joints under a head, random weights: time does not depend on them."""
    rng = np.random.default_rng(0)
    names, parents, places = ["hips", "hips/head"], [-1, 0], [(0, 1, 0), (0, 1.6, 0)]
    for chain in range(chains):
        above = 1
        for joint in range(5):
            names.append(f"{names[above]}/hair_{chain}_{joint}")
            parents.append(above)
            places.append((0.1 * np.cos(chain), 1.6 - 0.06 * joint, 0.1 * np.sin(chain)))
            above = len(names) - 1
    bind = np.tile(np.eye(4), (len(names), 1, 1))
    bind[:, :3, 3] = places
    found = find_chains(Character(Skeleton(tuple(names), np.array(parents), bind)))
    spec = rig_spec(dynamic)
    size, layers = len(feature_columns(spec)), []
    for out in (hidden, hidden, 3 * len(found)):
        layers.append((rng.normal(0, size**-0.5, (out, size)), rng.normal(0, 0.1, out)))
        size = out
    return RigModel(found, spec, tuple(layers), input_limits(spec))


def _c(folder, source: str, flags: str) -> float:
    (Path(folder) / "time.c").write_text(source)
    subprocess.run(["gcc", "-std=c99", *flags.split(), "time.c", "-lm", "-o", "time"], cwd=folder, check=True)
    return float(subprocess.run(["./time"], cwd=folder, check=True, capture_output=True, text=True).stdout)


def _python(model: RigModel, avatars: int = 10_000) -> dict[str, float]:
    features = np.random.default_rng(0).uniform(-1, 1, (avatars, model.inputs)).astype(np.float32)
    result = {"Python, numpy, batch of 10,000": _best(lambda: model.evaluate(features)) / avatars}
    try:
        import onnxruntime as ort
    except ImportError:
        return result
    settings = ort.SessionOptions()
    settings.intra_op_num_threads = 1
    session = ort.InferenceSession(rig_graph(model), settings, providers=["CPUExecutionProvider"])
    result["Python, onnxruntime, batch of 10,000"] = _best(lambda: session.run(None, {"features": features})) / avatars
    result["Python, numpy, one avatar"] = _best(lambda: model.evaluate(features[0]))
    return result


def _best(work, runs: int = 15) -> float:
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return 1e6 * min(times)


def _spring(model: RigModel) -> str:
    chains = model.chains
    first = np.array([np.flatnonzero(chains.bone_joint == j)[0] for j in range(len(chains))])
    way = chains.ways

    def rows(values):
        return ", ".join("{" + ", ".join(f"{v:.7f}f" for v in row) + "}" for row in values)

    values = {
        "JOINTS": str(len(chains)),
        "PARENTS": ", ".join(map(str, chains.parents)),
        "WAY": rows(way),
        "AXIS": rows(chains.bones[first] / chains.lengths[first, None]),
        "LENGTH": ", ".join(f"{v:.7f}f" for v in chains.lengths[first]),
    }
    text = SPRING
    for name, value in values.items():
        text = text.replace(f"@{name}@", value)
    return text


if __name__ == "__main__":
    main()
