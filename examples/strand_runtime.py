# SPDX-License-Identifier: Apache-2.0
"""The strand network in a runtime of one's own: python examples/strand_runtime.py FOLDER SHOT BAKED [NAME=VALUE ...]

FOLDER is what `neuralocks export -o FOLDER --shot SHOT` wrote, BAKED what `neuralocks bake SHOT -o BAKED --no-resolve`
wrote, with `--material NAME=VALUE` if that is given here (bend, weight, damping or clumping). Nothing of Neuralocks is
imported: this is a worked example of `description.json` for those who write the same in an engine, and it prints how far its
strands are from the bake's. The stage must be in metres, Y up, its animation on ones, without cuts and without changing blend
shapes. The network's strands have 24 vertices, even in arc length, and no corner above 52 degrees.
If the groom's strands are different, the bake lays them along the network's with their own lengths, which this example does
not: then the median tells whether the runtime is right, and a few tips are off. On the shipped shot, these are 1e-5 m and 2 cm.
"""

import argparse
import json
import math
import sys
from pathlib import Path

import numpy as np
import onnxruntime
from pxr import Usd, UsdGeom, UsdSkel
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

GRAVITY = np.array([0.0, -9.81, 0.0])
DEFAULT = {"bend": 1e-3, "weight": 1.0, "damping": 10.0, "clumping": 60.0}


class Runtime:
    """One groom in one material: what is the same in all frames is read once; `strands` computes a frame."""

    def __init__(self, folder: Path, name: str, material: dict[str, float]):
        described = json.loads((folder / "description.json").read_text("utf-8"))
        self.model, self.parts = described["model"], described["boundary vector"]["parts"]
        self.weights = np.array(described["boundary vector"]["bin weights"])
        self.fixed = dict(np.load(folder / name))
        self.frame, self.tail = (onnxruntime.InferenceSession(folder / f"{n}.onnx") for n in ("frame", "tail"))
        material = DEFAULT | material
        bend, weight, damping, clumping = (material[name] / DEFAULT[name] for name in DEFAULT)
        self.pace = np.sqrt(weight)
        self.fixed["held"][slice(*self.parts["material"])] = [np.log(bend / weight), 0, np.log(damping / self.pace), 0]
        self.fixed["anchor"][:] = 0
        if self.model.get("anchored"):
            self.fixed["anchor"] = self.answer("offsets", self.made(self.fixed["held"]))
        length = np.maximum(self.fixed["length"], 1e-3)
        own = 12.36 * material["bend"] / length**4 + 9.81 * material["weight"] / length
        tie = self.fixed["tie"]
        self.stray = ((own + 120 * tie) / (own + 120 * clumping * tie))[:, None, None]

    def turns(self, rotations: np.ndarray) -> np.ndarray:
        """(T, n, 3, 3) world rotations of the named joints, from the bind pose."""
        return rotations @ np.swapaxes(self.fixed["bind"], -1, -2) @ self.fixed["facing"].T

    def vector(self, places: np.ndarray, turns: np.ndarray, drawn: np.ndarray) -> np.ndarray:
        """The boundary vector (F,) of the newest of some moments, each the model's dt / `pace` before the one before it.

        Args:
            places: (steps + 2, 3) positions of the head joint, newest first [m].
            turns: (steps + 2, n, 3, 3) from `turns`; head, upper chest, pose joints.
            drawn: (n, 3, 3), the same for the pose that is drawn at the newest moment.
        """
        dt, bins = self.model["boundary"]["dt"], self.model["boundary"]["bins"]
        result = self.fixed["held"].copy()  # shape and material do not change
        head = drawn[0]
        pose = head.T @ drawn[2:] @ self.fixed["stance"]
        result[slice(*self.parts["pose"])] = pose[:, :, :2].transpose(0, 2, 1).ravel()
        gravity = head.T @ GRAVITY / 9.81
        result[slice(*self.parts["gravity"])] = gravity
        to_head = turns[:-2, 0].transpose(0, 2, 1)
        linear, steps = self.model["boundary"]["linear"], []
        if linear == "gravity":
            push = (places[:-2] - 2 * places[1:-1] + places[2:]) / dt**2
            steps = [limited((to_head @ (GRAVITY - push)[..., None])[..., 0] / 9.81 - gravity, 6)]
        elif linear == "velocity":
            steps = [limited((to_head @ (places[:-2] - places[1:-1])[..., None])[..., 0] / dt, 25)]
        for joint in (0, 1) if self.model["boundary"]["chest"] else (0,):
            turn = Rotation.from_matrix(turns[:-2, joint] @ turns[1:-1, joint].transpose(0, 2, 1)).as_rotvec()
            steps.append(limited((to_head @ turn[..., None])[..., 0] / dt, 25))
        ends = np.cumsum(bins)
        means = [np.concatenate(steps, 1)[end - size : end].mean(0) for end, size in zip(ends, bins)]
        result[slice(*self.parts["history"])] = (np.array(means) * self.weights[:, None]).ravel()
        return result

    def made(self, vector: np.ndarray) -> dict[str, np.ndarray]:
        """Outputs of frame.onnx for a boundary vector."""
        return {o.name: v for o, v in zip(self.frame.get_outputs(), self.frame.run(None, {"frame": vector[None]}))}

    def answer(self, output: str, frame: dict[str, np.ndarray]) -> np.ndarray:
        """An output of tail.onnx for the strands."""
        same = {name: self.fixed[name] for name in ("strand_part", "anchor", "edges")}
        return self.tail.run([output], same | frame)[0]

    def lock_means(self, moved: np.ndarray) -> np.ndarray:
        """The mean (S, 24, 3) of what the strands of each strand's lock do, of which `moved` (S, 24, 3) is each one's own."""
        lock, valid = self.fixed["lock"], self.fixed["valid"]
        total = np.zeros((lock.max() + 1, *moved.shape[1:]))
        np.add.at(total, lock[valid], moved[valid])
        return (total / np.bincount(lock[valid], minlength=len(total)).clip(1)[:, None, None])[lock]

    def strands(self, vector: np.ndarray, head: np.ndarray) -> np.ndarray:
        """World points (S, 24, 3) [m] for a boundary vector and the head joint's world transform (4, 4) in the stage."""
        frame = self.made(vector)
        moved = self.answer("displacement", frame).reshape(-1, 24, 3)
        if (self.stray != 1).any():
            led = self.lock_means(moved)
            edges = np.diff(self.fixed["rest"], axis=1)
            wanted = edges + np.diff(led + self.stray * (moved - led), axis=1)
            own, size = (np.linalg.norm(e, axis=2, keepdims=True) for e in (edges + np.diff(moved, axis=1), wanted))
            moved[:, 2:] = np.cumsum((wanted * own / size.clip(1e-12) - edges)[:, 1:], axis=1)
        moved *= self.fixed["valid"][:, None, None]
        head = head.copy()
        head[:3, :3] /= self.fixed["size"]
        to_world = head @ self.fixed["canonical_to_head"]
        return (self.fixed["rest"] + moved) @ to_world[:3, :3].T + to_world[:3, 3]


def limited(vectors: np.ndarray, longest) -> np.ndarray:
    """Vectors (n, 3), limited to a length, or to one each (n, 1)."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors * np.minimum(1, longest / np.maximum(length, 1e-9))


def softened(times: np.ndarray, places: np.ndarray, dt: float = 1 / 30) -> np.ndarray:
    """A path (T, 3) whose velocity changes at a sample by at most what 6 g cause in the time to the next, or in dt if longer."""
    spans = np.diff(times)
    velocity = np.diff(places, axis=0) / spans[:, None]
    longest = 6 * 9.81 * np.maximum((spans[1:] + spans[:-1]) / 2, dt)[:, None]
    velocity[1:] = velocity[0] + np.cumsum(limited(np.diff(velocity, axis=0), longest), axis=0)
    return np.concatenate([places[:1], places[0] + np.cumsum(velocity * spans[:, None], axis=0)])


def turned(transforms: np.ndarray) -> np.ndarray:
    """Rotations (..., 3, 3) of transforms (..., 4, 4) that scale equally in all directions."""
    linear = transforms[..., :3, :3]
    return linear / np.cbrt(np.linalg.det(linear))[..., None, None]


def joints_of(facts: dict) -> list[str]:
    """Paths of the joints that a groom's boundary vector is made from: head, upper chest, pose joints."""
    joints = facts["joints"]
    return [joints["head"], joints["upper chest"], *joints["pose"]]


class Motion:
    """Joints' world transforms at any time, as a bake reads them from a stage; an engine has its own way."""

    def __init__(self, stage: Usd.Stage, skeleton: str, joints: list[str], origin: np.ndarray):
        self._prim = stage.GetPrimAtPath(skeleton)
        self._query = UsdSkel.Cache().GetSkelQuery(UsdSkel.Skeleton(self._prim))
        self._pick = [list(self._query.GetJointOrder()).index(joint) for joint in joints]
        codes = clip_codes(stage, self._query.GetAnimQuery().GetJointTransformTimeSamples())
        self._times, world = np.array(codes) / stage.GetTimeCodesPerSecond(), np.stack([self.drawn(c) for c in codes])
        rotations = Rotation.from_matrix(turned(world).reshape(-1, 3, 3)).as_quat().reshape(len(codes), -1, 4)
        for last, q in zip(rotations, rotations[1:]):
            q *= np.where((last * q).sum(-1, keepdims=True) < 0, -1, 1)
        self._curve = CubicSpline(self._times, softened(self._times, world[:, 0, :3] @ origin), bc_type="natural")
        self._turn = CubicSpline(self._times, rotations, bc_type="natural")

    def drawn(self, code: float) -> np.ndarray:
        """World transforms (n, 4, 4) of the joints as USD shows them at a time code."""
        place = UsdGeom.XformCache(code)
        local = np.array(self._query.ComputeJointSkelTransforms(place.GetTime()))[self._pick]
        return (local @ np.array(place.GetLocalToWorldTransform(self._prim))).transpose(0, 2, 1)

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions (T, 3) of the hair's origin and joint rotations (T, n, 3, 3); straight on before the clip, still after it."""
        inside = np.clip(times, *self._times[[0, -1]])
        places = self._curve(inside) + np.minimum(times - inside, 0)[:, None] * self._curve(inside, 1)
        turns = Rotation.from_quat(self._turn(inside).reshape(-1, 4)).as_matrix()
        return places, turns.reshape(len(times), -1, 3, 3)


def clip_codes(stage: Usd.Stage, samples: list[float]) -> list[float]:
    """Time codes at which a bake reads the motion; `clip` in the description says why. The shot must have frames."""
    second, start, end = stage.GetTimeCodesPerSecond(), stage.GetStartTimeCode(), stage.GetEndTimeCode()
    before = [start] if samples[0] - start >= 0.1 * second - 1e-6 else []
    codes = [*before, *samples, max(end, samples[-1])]
    gaps = [(a, b) for a, b in zip(codes, codes[1:]) if b - a > 0.0625 * second]
    return sorted({*codes, *(float(code) for a, b in gaps for code in range(math.ceil(a), math.ceil(b)))})


def curves_at(stage: Usd.Stage, prim: str) -> UsdGeom.BasisCurves:
    """The groom of a stage; exits if there is none."""
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath(prim))
    if not curves:
        file = stage.GetRootLayer().GetDisplayName()
        sys.exit(f"{file}: has no curves {prim}; FOLDER and BAKED must both be made of SHOT")
    return curves


def shares(curves: UsdGeom.BasisCurves) -> list[np.ndarray]:
    """Positions of the vertices along each of the groom's strands as modelled: shares of its length, from 0 to 1."""
    counts, points = (
        each.Get() or each.Get(Usd.TimeCode.EarliestTime())
        for each in (curves.GetCurveVertexCountsAttr(), curves.GetPointsAttr())
    )
    strands = np.split(np.array(points, dtype=float), np.cumsum(counts)[:-1])
    lengths = [np.append(0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))) for points in strands]
    return [length / max(length[-1], 1e-12) for length in lengths]


def evenly(points: np.ndarray, at: list[np.ndarray]) -> np.ndarray:
    """24 points (S, 24, 3) at even shares of the length of strands, whose vertices are at the shares `at`."""
    even, ends = np.linspace(0, 1, 24), np.cumsum([len(shares) for shares in at])[:-1]
    strands = zip(at, np.split(points, ends))
    return np.array([np.stack([np.interp(even, own, axis) for axis in strand.T], axis=1) for own, strand in strands])


def differences(folder: Path, shot: Path, baked: Path, material: dict[str, float]) -> np.ndarray:
    """Distance of this runtime's strands from a bake's in the same material, at each vertex in each sample [m]."""
    described = json.loads((folder / "description.json").read_text("utf-8"))
    if "grooms" not in described:
        sys.exit(f"{folder}: holds no groom; let neuralocks export write it with --shot SHOT")
    files = described["grooms"]["files"]
    stage, result, found = Usd.Stage.Open(str(shot)), Usd.Stage.Open(str(baked)), []
    unit, up = UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)
    if unit != 1 or up != UsdGeom.Tokens.y:
        sys.exit(f"{shot}: counts in {unit:g} m and has {up} up; this example reads stages in metres with Y up alone")
    for name, facts in files.items():
        at, curves = shares(curves_at(stage, facts["prim"])), curves_at(result, facts["prim"])
        runtime = Runtime(folder, name, material)
        origin = [*runtime.fixed["canonical_to_head"][:3, 3] / runtime.fixed["size"], 1]
        motion = Motion(stage, facts["skeleton"], joints_of(facts), np.array(origin))
        boundary = runtime.model["boundary"]
        for code in curves.GetPointsAttr().GetTimeSamples():
            now = code / stage.GetTimeCodesPerSecond()
            step = boundary["dt"] / runtime.pace
            places, rotations = motion.at(now - step * np.arange(sum(boundary["bins"]) + 2))
            drawn = motion.drawn(code)
            ours = runtime.strands(runtime.vector(places, *map(runtime.turns, (rotations, turned(drawn)))), drawn[0])
            to_world = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(curves.GetPrim()))
            theirs = np.array(curves.GetPointsAttr().Get(code)) @ to_world[:3, :3] + to_world[3, :3]
            found.append(np.linalg.norm(ours - evenly(theirs, at), axis=2).ravel())
    return np.concatenate(found)


def setting(word: str) -> tuple[str, float]:
    """The name and the number of NAME=VALUE; a ValueError tells argparse that a word is invalid."""
    name, value = word.split("=")
    return name, float(value)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("folder", "shot", "baked"):
        parser.add_argument(name, type=Path)
    # Without a default, the error for an empty line would call it required.
    parser.add_argument("material", nargs="*", default=[], metavar="NAME=VALUE", type=setting)
    given = parser.parse_args()
    numbers = dict(given.material)
    if unknown := numbers.keys() - DEFAULT:
        parser.error(f"no such material: {', '.join(unknown)}; there are {', '.join(DEFAULT)}")
    off = differences(given.folder, given.shot, given.baked, numbers)
    print(f"{np.median(off):.1e} m in the median and {off.max():.1e} m at most from the bake")
