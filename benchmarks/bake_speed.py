# SPDX-License-Identifier: Apache-2.0
"""A bake of a large groom: wall time beside inference alone and writing alone, memory, and the runtime's import time.

    python benchmarks/bake_speed.py [MODEL] [--strands 120000] [--frames 24]

The groom is grown on the shipped character. Memory is the peak of the bake's own process above what it held once the
shot was read; the number of frames is doubled to see whether it grows. Run it on an idle machine.
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

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))


def main() -> None:
    """Print everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", nargs="?")
    parser.add_argument("--strands", type=int, default=120000)
    parser.add_argument("--frames", type=int, default=12)
    arguments = parser.parse_args()
    print(f"import of the runtime: {1000 * import_time():.0f} ms, torch in it: {'yes' if brings_torch() else 'no'}")
    with tempfile.TemporaryDirectory(dir=os.environ.get("NEURALOCKS_SCRATCH")) as folder:
        shot = large_shot(Path(folder), arguments.strands)
        memory = {}
        for frames in (arguments.frames, 2 * arguments.frames):
            out = Path(folder) / f"bake{frames}.usdc"
            result = in_process(_bake, shot, out, arguments.model, frames)
            memory[frames] = result["memory"]
            size = out.stat().st_size
            out.unlink()
            print(
                f"bake, {arguments.strands} strands, {frames} frames: {result['seconds']:.2f} s, "
                f"{size / 1e6:.0f} MB written, {result['memory']:.0f} MB above the shot"
            )
        frames = arguments.frames
        alone = in_process(_infer, shot, None, arguments.model, frames)["seconds"]
        written = in_process(_write, shot, Path(folder) / "plain.usdc", arguments.model, frames)["seconds"]
        again = in_process(_bake, shot, Path(folder) / "bake.usdc", arguments.model, frames)["seconds"]
        print(f"{frames} frames: bake {again:.2f} s, inference alone {alone:.2f} s, writing alone {written:.2f} s")
        print(f"bake / larger of both: {again / max(alone, written):.2f}")


def import_time() -> float:
    """Seconds that the runtime adds to a start of Python; the best of three."""
    def once(code):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
        return time.perf_counter() - start

    bare = min(once("pass") for _ in range(3))
    return min(once("import neuralocks_core.runtime, onnxruntime") for _ in range(3)) - bare


def brings_torch() -> bool:
    """Whether importing the runtime and the bake imports torch."""
    code = "import sys, usd.bake, neuralocks_core.runtime, onnxruntime; print('torch' in sys.modules)"
    return "True" in subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True).stdout


def large_shot(folder: Path, strands: int) -> Path:
    """The shipped shot with its groom's strands repeated beside themselves."""
    from pxr import Usd, UsdGeom, Vt

    from usd.demo import shipped_shot

    path = folder / "large.usda"
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
        return pool.apply(function, arguments)


def _bake(shot, out, model, frames) -> dict:
    from neuralocks_core.runtime import StrandModel
    from usd.bake import bake
    from usd.stage import read_shot

    ready, loaded = read_shot(shot), StrandModel.load(model)
    before, start = _peak(), time.perf_counter()
    bake(ready, out, loaded, frames=f"1:{frames}", velocities=False, resolve=False)
    return {"seconds": time.perf_counter() - start, "memory": _peak() - before}


def _infer(shot, out, model, frames) -> dict:
    from neuralocks_core.runtime import StrandModel
    from usd.posing import GroomPoser
    from usd.stage import read_shot

    ready, loaded = read_shot(shot), StrandModel.load(model)
    start = time.perf_counter()
    with GroomPoser(ready.grooms[0], loaded, jobs=2) as poser:
        for code in range(1, frames + 1):
            poser.points(code)
    return {"seconds": time.perf_counter() - start}


def _write(shot, out, model, frames) -> dict:
    from pxr import Sdf, Usd, UsdGeom, Vt

    from usd.stage import read_shot

    points = read_shot(shot).grooms[0].groom.points
    rng = np.random.default_rng(0)
    arrays = [points + np.float32(rng.normal()) for _ in range(3)]
    start = time.perf_counter()
    stage = Usd.Stage.CreateNew(str(out))
    attribute = UsdGeom.BasisCurves.Define(stage, "/Hair").GetPointsAttr()
    layer = stage.GetRootLayer()
    for frame in range(frames):
        # Each frame differs in one number, or USD would store equal arrays once.
        array = arrays[frame % 3]
        array[0, 0] = frame
        layer.SetTimeSample(Sdf.Path(attribute.GetPath()), frame, Vt.Vec3fArray.FromNumpy(array))
        layer.Save()
    return {"seconds": time.perf_counter() - start}


def _peak() -> float:
    """Largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()
