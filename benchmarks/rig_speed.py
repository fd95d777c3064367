# SPDX-License-Identifier: Apache-2.0
"""Cost of rigged mesh hair per avatar and update: network, history and both, beside VRM spring bones, in one run.

    python benchmarks/rig_speed.py [--joints 16 32] [--json]

*All* is what an engine runs whenever the animation is updated: of a dynamic model history_push, history_read and evaluate, of a
quasi-static one, which has no history, evaluate alone; spring bones move their tails on and turn the joints. Each character
has its own state, and no two successive inputs are equal. A crowd is 1,000 characters in turn, whose states are in no cache of
a core. Updates are 1/60 s apart, or up to a fifth more or less (*uneven*), which no branch predictor learns.
C programs are built with gcc; times are the best of many short runs (a quarter of a million updates), so that other work on the
machine counts little, but in a crowd it does: what it leaves of the cache decides how fast histories are read. In Python, *all*
is the sampling of the clip as in a bake, and the network. It takes two or three minutes.
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
from neuralocks_core.motion import Clip
from neuralocks_core.rig import RigModel, RigSampler, find_chains, rig_spec
from neuralocks_core.rig.export_c import export_c
from neuralocks_core.rig.graph import rig_graph
from neuralocks_core.rig.network import feature_columns, input_limits
from neuralocks_core.rotation import from_vector

CLOCK = """#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stdio.h>
#include <time.h>
#define SETS 1024
#define RUNS 1000
#define UPDATES 256 /* of each run: short enough that some runs are not interrupted */
#define FULL (128 * CROWD) /* updates until all histories are full */
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec; }
"""
TIMING = """#include "hair.h"
static nl_hair_input in[SETS];
static nl_hair_output out;
static float place[SETS][3];
#ifdef NL_HAIR_BINS
static nl_hair_history history[CROWD];
#endif
#ifdef UNEVEN
static unsigned int seed = 1u;
static double step(void) { seed = 1664525u * seed + 1013904223u; return 0.8 + 0.4 * (double)(seed >> 8) / 16777216.0; }
#else
static double step(void) { return 1.0; }
#endif
static double best_of(int network, int past) {
  static double time = 0.0;
  int run, i, n = 0;
  double best = 1e9;
  volatile float sink = 0.0f;
  (void)past;
  for (run = 0; run < RUNS; ++run) {
    double t = now();
    for (i = 0; i < UPDATES; ++i, ++n) {
      const int who = n % CROWD, set = (n / CROWD + 37 * who) & (SETS - 1);
      if (who == 0) time += step() / 60.0;
#ifdef NL_HAIR_BINS
      if (past) {
        nl_hair_history_push(&history[who], time, place[set], in[set].head);
        nl_hair_history_read(&history[who], in[set].down, in[set].history);
      }
#endif
      if (network) { nl_hair_evaluate(&in[set], &out); sink += out.turn[i & 7][1]; }
    }
    t = (now() - t) / UPDATES;
    if (n > FULL && t < best) best = t;
  }
  return sink > 1e30f ? 0.0 : 1e6 * best;
}
int main(void) {
  int i, j;
  for (i = 0; i < SETS; ++i) {
    const float a = 0.0061359232f * (float)i, turn = 0.3f * sinf(7.0f * a), nod = 0.1f * sinf(2.0f * a);
    in[i].head[0] = cosf(turn); in[i].head[1] = 0.8f * sinf(turn); in[i].head[2] = 0.6f * sinf(turn); in[i].head[3] = 0.0f;
    for (j = 0; j < 4; ++j) in[i].neck[j] = in[i].chest[j] = j == 0 ? cosf(nod) : j == 1 ? sinf(nod) : 0.0f;
    in[i].down[0] = in[i].down[2] = 0.0f; in[i].down[1] = -1.0f;
    place[i][0] = 0.1f * sinf(3.0f * a); place[i][1] = 1.6f; place[i][2] = 0.0f;
  }
#ifdef NL_HAIR_BINS
  for (i = 0; i < CROWD; ++i) nl_hair_history_reset(&history[i]);
  {
    const double history_alone = best_of(0, 1), network = best_of(1, 0);
    printf("%.6f %.6f %.6f\\n", best_of(1, 1), network, history_alone);
  }
#else
  printf("%.6f\\n", best_of(1, 0));
#endif
  return 0;
}
"""
SPRING = """#define N @JOINTS@
typedef struct { float x, y, z; } V;
typedef struct { float w, x, y, z; } Q;
static const int parent[N] = {@PARENTS@};
static const V way[N] = {@WAY@}, axis[N] = {@AXIS@};
static const float length[N] = {@LENGTH@};
typedef struct { V tail[N], prev[N]; } S;
static S state[CROWD]; static Q turn[N], world[N]; static V place[N];
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
static void update(S *s, Q head, V at, float dt) {
  V *tail = s->tail, *prev = s->prev;
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
int main(void) {
  static Q heads[SETS]; static V places[SETS]; int i, run, n = 0; double best = 1e9; volatile float sink = 0;
  for (i = 0; i < SETS; ++i) {
    float a = 0.3f * sinf(0.0061359f * (float)i * 7.0f); heads[i].w = cosf(a); heads[i].x = sinf(a); heads[i].y = heads[i].z = 0;
    places[i].x = 0.1f * sinf(0.0061359f * (float)i * 3.0f); places[i].y = 1.6f; places[i].z = 0;
  }
  for (run = 0; run < RUNS; ++run) {
    double t = now();
    for (i = 0; i < UPDATES; ++i, ++n) {
      const int who = n % CROWD, set = (n / CROWD + 37 * who) & (SETS - 1);
      update(&state[who], heads[set], places[set], 1.0f / 60.0f); sink += turn[i & 7].x;
    }
    t = (now() - t) / UPDATES; if (n > FULL && t < best) best = t;
  }
  printf("%.6f\\n", 1e6 * best);
  return sink > 1e30f;
}
"""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--joints", type=int, nargs="+", default=[16, 32], help="in chains of four; the shipped rig has 32"
    )
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    tables = {f"{max(4, n // 4 * 4)} hair joints": measured(max(1, n // 4)) for n in options.joints}
    if options.json:
        print(json.dumps(tables, indent=1))
        return
    for joints, rows in tables.items():
        print(f"{joints}, microseconds per avatar and update, one thread")
        print(f"  {'':72s} {'all':>8s} {'network':>8s} {'history':>8s}")
        for name, row in rows.items():
            cells = (f"{row[part]:8.3f}" if part in row else f"{'-':>8s}" for part in ("all", "network", "history"))
            print(f"  {name:72s} {' '.join(cells)}")


def measured(chains: int) -> dict[str, dict[str, float]]:
    """Microseconds per avatar and update of `all` and, of networks, of its parts, by what is updated, for chains of four joints."""
    rows, character = {}, _character(chains)
    with tempfile.TemporaryDirectory() as folder:
        for name, dynamic, hidden in (("quasi-static, 2 x 16", False, 16), ("dynamic, 2 x 32", True, 32)):
            model = _model(character, hidden, dynamic)
            export_c(model, Path(folder) / "hair.h")
            for where, flags in _builds(uneven=dynamic):
                rows[f"C, {name}, {where}"] = dict(zip(("all", "network", "history"), _c(folder, TIMING, flags)))
            rows |= {f"{where}, {name}": row for where, row in _python(character, model).items()}
        for where, flags in _builds():
            rows[f"C, VRM spring bones with one collider, {where}"] = {"all": _c(folder, _spring(model), flags)[0]}
    return rows


def _builds(uneven: bool = False) -> list[tuple[str, list[str]]]:
    optimised = ("-O2", "-O3 -march=native")
    builds = [(flags, [*flags.split(), "-DCROWD=1"]) for flags in optimised]
    builds += [(f"crowd of 1,000, {flags}", [*flags.split(), "-DCROWD=1000"]) for flags in optimised]
    return builds + [("uneven, -O2", ["-O2", "-DCROWD=1", "-DUNEVEN"])] * uneven


def _character(chains: int) -> Character:
    """A head with chains of four joints."""
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
    return Character(Skeleton(tuple(names), np.array(parents), bind))


def _model(character: Character, hidden: int, dynamic: bool) -> RigModel:
    """Random weights: time does not depend on them."""
    rng, found = np.random.default_rng(0), find_chains(character)
    spec = rig_spec(dynamic)
    size, layers = len(feature_columns(spec)), []
    for out in (hidden, hidden, 3 * len(found)):
        layers.append((rng.normal(0, size**-0.5, (out, size)), rng.normal(0, 0.1, out)))
        size = out
    return RigModel(found, spec, tuple(layers), input_limits(spec))


def _c(folder, source: str, flags: list[str]) -> list[float]:
    (Path(folder) / "time.c").write_text(CLOCK + source)
    subprocess.run(["gcc", "-std=c99", *flags, "time.c", "-lm", "-o", "time"], cwd=folder, check=True)
    done = subprocess.run(["./time"], cwd=folder, check=True, capture_output=True, text=True)
    return [float(number) for number in done.stdout.split()]


def _python(character: Character, model: RigModel, avatars: int = 10_000) -> dict[str, dict[str, float]]:
    times = np.arange(avatars) / 60
    joints = np.tile(character.skeleton.bind, (avatars, 1, 1, 1))
    joints[:, character.head, :3, :3] = from_vector(np.outer(0.6 * np.sin(4 * times), [0.8, 0.6, 0]))
    sampler = RigSampler(model.spec, character, Clip(times, joints))
    features = sampler.features(times)
    sampling = _best(lambda: sampler.features(times), 3) / avatars
    numpy, one = _best(lambda: model.evaluate(features)) / avatars, _best(lambda: model.evaluate(features[0]))
    result = {
        "Python, numpy, batch of 10,000": {"all": sampling + numpy, "network": numpy, "history": sampling},
        "Python, numpy, one avatar": {"network": one},
    }
    try:
        import onnxruntime as ort
    except ImportError:
        return result
    settings = ort.SessionOptions()
    settings.intra_op_num_threads = 1
    session = ort.InferenceSession(rig_graph(model), settings, providers=["CPUExecutionProvider"])
    onnx = _best(lambda: session.run(None, {"features": features})) / avatars
    return result | {
        "Python, onnxruntime, batch of 10,000": {"all": sampling + onnx, "network": onnx, "history": sampling}
    }


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
