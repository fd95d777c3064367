# SPDX-License-Identifier: Apache-2.0
"""A bake of a large groom: wall time beside posing alone and writing alone, memory, and the runtime's import time.

    python benchmarks/bake_speed.py [MODEL] [--strands 120000] [--frames 36] [--pairs 5]

The groom is grown on the shipped character. Bakes and posing alone take turns, because the speed of a machine changes
over time. Memory is the peak of the bake's own process above what it held once the shot was read; finally, the number of
frames is doubled to see whether it grows. Run it on an idle machine; on a busy one, only the CPU times and the memory
mean something. The bakes, some gigabytes, are temporarily in the folder that the environment variable
NEURALOCKS_SCRATCH names, or else in the system's folder for temporary files.
"""

import argparse
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, before numpy is imported
import numpy as np

ROOT = Path(__file__).resolve().parents[1]


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", nargs="?")
    parser.add_argument("--strands", type=int, default=120000)
    parser.add_argument("--frames", type=int, default=36)
    parser.add_argument("--pairs", type=int, default=5)
    arguments = parser.parse_args()
    print(f"import of the runtime: {1000 * import_time():.0f} ms, torch in it: {'yes' if brings_torch() else 'no'}")
    with tempfile.TemporaryDirectory(dir=os.environ.get("NEURALOCKS_SCRATCH")) as folder:
        shot = large_shot(Path(folder), arguments.strands)
        for plain in (True, False):
            _compared(shot, Path(folder), arguments.model, arguments.frames, arguments.pairs, plain)


def _compared(shot: Path, folder: Path, model, frames: int, pairs: int, plain: bool) -> None:
    print(
        "points only, not kept out of the body:" if plain else "as by default, with velocities, kept out of the body:"
    )
    ratios = []
    for _ in range(pairs):
        bake = _baked(shot, folder, model, frames, plain)
        alone = in_process(_infer, shot, None, model, frames, plain)
        plain_file = folder / "plain.usdc"
        written = in_process(_write, shot, plain_file, model, frames, plain)
        plain_file.unlink()
        ratios.append([bake[key] / max(alone[key], written[key]) for key in ("seconds", "busy")])
        print(
            f"  {frames} frames: bake {bake['seconds']:.2f} s, posing alone {alone['seconds']:.2f} s, writing the same "
            f"alone {written['seconds']:.2f} s; bake / larger {ratios[-1][0]:.2f}, of CPU times {ratios[-1][1]:.2f}",
            flush=True,
        )
    wall, busy = np.median(ratios, axis=0)
    print(f"  median of {pairs} pairs: bake / larger {wall:.2f}, of CPU times {busy:.2f}")
    _baked(shot, folder, model, 2 * frames, plain)


def _baked(shot: Path, folder: Path, model, frames: int, plain: bool) -> dict:
    out = folder / "bake.usdc"
    result = in_process(_bake, shot, out, model, frames, plain)
    size = out.stat().st_size
    out.unlink()
    print(
        f"  {frames} frames: {result['seconds'] / frames:.2f} s a frame, {size / 1e6:.0f} MB written, "
        f"{result['memory']:.0f} MiB above the shot",
        flush=True,
    )
    return result


def import_time() -> float:
    """Seconds that importing the runtime adds to a start of Python; the best of three."""

    def once(code):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
        return time.perf_counter() - start

    bare = min(once("pass") for _ in range(3))
    return min(once("import neuralocks_core.models.runtime, onnxruntime") for _ in range(3)) - bare


def brings_torch() -> bool:
    """Whether importing the runtime and the bake imports torch."""
    code = "import sys, usd.baking.bake, neuralocks_core.models.runtime, onnxruntime; print('torch' in sys.modules)"
    return "True" in subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True).stdout


def large_shot(folder: Path, strands: int) -> Path:
    """The shipped shot with copies of its groom's strands beside them."""
    from pxr import Usd, UsdGeom, Vt

    from usd.review.demo import shipped_shot

    path = folder / "large.usdc"
    stage = Usd.Stage.CreateNew(str(path))
    stage.GetRootLayer().subLayerPaths.append(str(shipped_shot()))
    under = Usd.Stage.Open(str(shipped_shot()))
    for key in ("metersPerUnit", "upAxis", "timeCodesPerSecond", "startTimeCode", "endTimeCode"):
        if under.HasAuthoredMetadata(key):
            stage.SetMetadata(key, under.GetMetadata(key))
    prim = next(p for p in stage.Traverse() if p.IsA(UsdGeom.BasisCurves))
    curves = UsdGeom.BasisCurves(prim)
    counts = np.array(curves.GetCurveVertexCountsAttr().Get())
    points = np.array(curves.GetPointsAttr().Get()).reshape(len(counts), counts[0], 3)
    copies = -(-strands // len(counts))
    rng = np.random.default_rng(0)
    many = np.repeat(points, copies, axis=0)[:strands]
    many = many + rng.normal(0, 0.002, (strands, 1, 3)) * np.linspace(0, 1, counts[0])[None, :, None]
    curves.GetCurveVertexCountsAttr().Set(Vt.IntArray.FromNumpy(np.full(strands, counts[0], np.int32)))
    curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(many.reshape(-1, 3).astype(np.float32)))
    curves.GetWidthsAttr().Set(Vt.FloatArray([0.0001]))
    curves.SetWidthsInterpolation("constant")
    for primvar in UsdGeom.PrimvarsAPI(prim).GetPrimvars():
        if primvar.GetInterpolation() in ("uniform", "vertex", "varying"):
            primvar.GetAttr().Block()
    stage.Save()
    return path


def in_process(function, *arguments) -> dict:
    """Result of a function in a fresh process, so that its memory is its own."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_told, (function, *arguments))


def _told(function, *arguments) -> dict:
    """Call a function; an error that cannot be sent to another process is sent as its message."""
    try:
        return function(*arguments)
    except Exception as error:
        raise RuntimeError(f"{type(error).__name__}: {error}") from None


def _bake(shot, out, model, frames, plain) -> dict:
    from neuralocks_core.models.runtime import StrandModel
    from usd.baking.bake import bake
    from usd.shot.stage import read_shot

    ready, loaded = read_shot(shot), StrandModel.load(model)
    before, start, busy = _forget_peak(), time.perf_counter(), time.process_time()
    bake(ready, out, loaded, frames=f"1:{frames}", velocities=not plain, resolve=not plain)
    return _spent(start, busy) | {"memory": _peak() - before}


def _infer(shot, out, model, frames, plain) -> dict:
    from neuralocks_core.models.runtime import StrandModel
    from usd.baking.points.posing import GroomPoser
    from usd.shot.stage import read_shot

    ready, loaded = read_shot(shot), StrandModel.load(model)
    start, busy = time.perf_counter(), time.process_time()
    poser = GroomPoser(ready.grooms[:1], loaded, resolve=not plain)
    for code in range(1, frames + 1):
        poser.points(code)
    return _spent(start, busy)


def _write(shot, out, model, frames, plain) -> dict:
    from pxr import Usd, UsdGeom, Vt

    from usd.shot.stage import read_shot

    points = read_shot(shot).grooms[0].groom.points.copy()
    start, busy = time.perf_counter(), time.process_time()
    stage = Usd.Stage.CreateNew(str(out))
    curves = UsdGeom.BasisCurves.Define(stage, "/Hair")
    attributes = [curves.CreatePointsAttr()] + ([] if plain else [curves.CreateVelocitiesAttr()])
    for frame in range(frames):
        for number, attribute in enumerate(attributes):
            # Each array differs in one number, or USD would store equal arrays only once.
            points[0, 0] = frame + 0.5 * number
            attribute.Set(Vt.Vec3fArray.FromNumpy(points.reshape(-1)), frame)
            stage.GetRootLayer().Save()
    return _spent(start, busy)


def _spent(start: float, busy: float) -> dict:
    return {"seconds": time.perf_counter() - start, "busy": time.process_time() - busy}


def _forget_peak() -> float:
    """Current memory of this process [MiB]; resets its peak if the system can."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
        return _status("VmRSS")
    except OSError:
        return _peak()


def _peak() -> float:
    """Largest memory of this process [MiB], since `_forget_peak` on Linux."""
    try:
        return _status("VmHWM")
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _status(key: str) -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(key)) / 1024


if __name__ == "__main__":
    main()
