# SPDX-License-Identifier: Apache-2.0
"""Join bakes of parts of a range, as the machines of a farm make them, into one bake of the whole range."""

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Ar, Sdf, Tf, Usd, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path
from neuralocks_core.progress import Progress, silent

from ..border.damage import first_line, named
from ..border.stage_files import LAYERS, check_file, check_layer_name, check_not_over, one_file, open_stage
from ..border.told_once import few
from ..border.units import Border
from ..shot.bakes.bake_record import KEY
from ..shot.bakes.gaps import gaps, some, thinned
from ..shot.made_from import INPUTS, unlike
from ..shot.notes.stage_notes import composition_notes, out_of_place
from ..skel.rig_copy import SOURCE
from .layer.header import relative, repeat_metadata
from .layer.override import deliver
from .layer.sample_layer import SampleLayer, in_order
from .layer.spool import Spool, fingerprint


@dataclass(frozen=True)
class JoinResult:
    """What a join did.

    Attributes:
        path: the layer written.
        grooms: prim paths.
        frames: time codes in the layer.
        complete: whether every groom has all frames of the shot.
        notes: what a user should know.
    """

    path: Path
    grooms: list[str]
    frames: list[float]
    complete: bool
    notes: list[str]


def join(parts, out, *, progress: Progress | None = None) -> JoinResult:
    """Write one bake from several of the same shot, byte for byte the same as one bake of all their frames and grooms.

    Parts may differ in frames, in grooms, or in both. Grooms of one head that were not baked together come out the same except for
    rounding. Memory does not grow with the number of frames, but text parts, `.usda`, are loaded whole.

    Args:
        parts: files that `bake` or `simulate` wrote, in any order, or a single one. If several have the same frame of a groom, the
            first file's counts.
        out: `.usdc`, `.usd` or `.usda` to write.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: a part is not a bake, is of a different shot than the first, or has a groom that another part baked with
            other options. Nothing is left under the output's name.
    """
    out = as_path(out, "out")
    check_layer_name(out)
    alone = isinstance(parts, str) or not isinstance(parts, Iterable)
    every = [_Part(as_path(part, "parts")) for part in ([parts] if alone else parts)]
    if not every:
        raise NeuralocksError("no parts: name the files that neuralocks bake wrote")
    stage = open_stage(every[0].path)
    for number, part in enumerate(every):
        part.check_alike(every[:number])
        if one_file(out, part.path):
            raise NeuralocksError(f"{out}: is one of the parts; choose another name")
    check_not_over(out, stage)
    frame = Border.of(stage).frame
    prims = _prims(every, stage)
    plan = {prim.path: _sources(prim.path, every) for prim in prims if any(prim.path in part.grooms for part in every)}
    _write(every, prims, plan, out, frame, progress or silent)
    codes = sorted({code for sources in plan.values() for code in sources})
    missing = _all_gaps(plan, frame, stage)
    thin = dict.fromkeys(note for sources in plan.values() for note in thinned(list(sources), frame))
    notes = composition_notes(stage, every[0].path) + missing + [*thin] + out_of_place(stage, out)
    return JoinResult(out, [str(groom) for groom in plan], codes, not missing, notes)


class _Part:
    """One part: its layer, and which grooms it has samples of."""

    def __init__(self, path: Path):
        self.path, self.layer = path, None
        check_file(path)
        if path.suffix.lower() not in LAYERS:
            raise self._no_bake()
        with self._named():
            self.layer = Sdf.Layer.FindOrOpen(str(path))
        if self.layer is None:
            raise NeuralocksError(f"{path}: cannot be read; bake that part again")
        self.grooms = [prim.path for prim in self.prims() if self._is_baked(prim)]
        if not self.grooms:
            raise self._no_bake()

    def _no_bake(self) -> NeuralocksError:
        if self.layer and any(SOURCE in prim.relationships for prim in self.prims()):
            return NeuralocksError(
                f"{self.path}: is a rig bake, and these are not joined from parts; bake all characters at once, or each over the "
                "bake of the one before"
            )
        return NeuralocksError(f"{self.path}: is not a bake; give files that neuralocks bake wrote")

    def prims(self) -> Iterator[Sdf.PrimSpec]:
        """All prims of the layer, as a stage has them."""
        return _below(self.layer.pseudoRoot)

    @contextmanager
    def _named(self) -> Iterator[None]:
        try:
            yield
        except Tf.ErrorException as error:
            raise NeuralocksError(f"{self.path}: cannot be read ({first_line(error)}); bake that part again") from None

    def _is_baked(self, prim: Sdf.PrimSpec) -> bool:
        # On a prim that is not a groom, the key holds one word instead: what else this program wrote there.
        return isinstance(prim.customData.get(KEY), dict) and bool(self.codes(prim.path))

    def codes(self, groom: Sdf.Path) -> list[float]:
        """Time codes of a groom's samples, ascending."""
        return list(self.layer.ListTimeSamplesForPath(groom.AppendProperty("points")))

    def value(self, groom: Sdf.Path, code: float, name: str, count: int | None = None) -> Vt.Vec3fArray:
        """The array of an attribute's sample; of `count` vectors, if that is known.

        Raises:
            NeuralocksError: it is missing, or damaged.
        """
        path = groom.AppendProperty(name)
        with self._named():
            found = self.layer.QueryTimeSample(path, code)
        if found is None:
            raise NeuralocksError(f"{self.path}: {path} has no sample at {code:g}; bake that part again")
        fact = ""
        if not isinstance(found, Vt.Vec3fArray):
            fact = "is not an array of vectors"
        elif count is not None and len(found) != count:
            fact = f"has {len(found)} values for {count}"
        elif not np.isfinite(found).all():
            fact = "holds NaN or infinity"
        if fact:
            raise NeuralocksError(f"{self.path}: {path} {fact} at {code:g}; bake that part again")
        return found

    def samples_of(self, groom: Sdf.Path, name: str) -> bool:
        """Whether there are samples of an attribute."""
        return self.layer.GetNumTimeSamplesForPath(groom.AppendProperty(name)) > 0

    def made(self, groom: Sdf.Path) -> dict:
        """The options that a groom was baked with."""
        codes = self.codes(groom)
        count = len(self.value(groom, codes[0], "points"))
        options = {"velocities": self.samples_of(groom, "velocities"), "number of points": count}
        return self.layer.GetPrimAtPath(groom).customData[KEY] | options

    def check_alike(self, others: list["_Part"]) -> None:
        """Refuse a part that cannot find its shot, has a different shot, or has a groom of other parts with other options."""
        for shot in self._shots():
            if not Ar.GetResolver().Resolve(shot):
                raise NeuralocksError(
                    f"{self.path}: does not find its shot ({shot}) from here; join where it was baked"
                )
        if others and self._shots() != others[0]._shots():
            raise NeuralocksError(
                f"{self.path}: is a bake of a different shot from {others[0].path}; join parts of one shot"
            )
        for groom in self.grooms:
            other = next((part for part in others if groom in part.grooms), self)
            mine, theirs = self.made(groom), other.made(groom)
            options = sorted(name for name in {*mine, *theirs} - {INPUTS} if mine.get(name) != theirs.get(name))
            if options:
                raise NeuralocksError(
                    f"{self.path}: {groom} was baked with different {', '.join(options)} than in {other.path}; "
                    "bake both with the same options"
                )
            if inputs := unlike(mine, theirs):
                raise NeuralocksError(
                    f"{self.path}: {groom} was baked from a different {' and '.join(inputs)} than in {other.path}; "
                    "bake the older one again"
                )

    def _shots(self) -> list[str]:
        return [os.path.realpath(self.layer.ComputeAbsolutePath(shot)) for shot in self.layer.subLayerPaths]


def _sources(groom: Sdf.Path, parts: list[_Part]) -> dict[float, _Part]:
    """Which part gives a groom's sample at each time code, ascending."""
    found: dict[float, _Part] = {}
    for part in parts:
        for code in part.codes(groom):
            found.setdefault(code, part)
    return dict(sorted(found.items()))


def _write(parts: list[_Part], prims: list[Sdf.PrimSpec], plan: dict, out: Path, frame: float, say: Progress) -> None:
    """Write the layer, with the samples that `plan` names by groom, and their part."""
    total, done = sum(map(len, plan.values())), 0
    spool = Spool(out, fingerprint([part.path for part in parts], {}))
    try:
        spool.drop_layers()
        file = SampleLayer(spool.layer_path, out)
        with named(out):
            _copy_header(parts[0].layer, file.layer, out, parts)
        for prim in prims:
            with named(out):
                _copy_prim(prim, file.layer)
            if prim.path in plan:
                for _ in _copy_samples(prim.path, plan[prim.path], file, frame):
                    done += 1
                    say(done, total, str(prim.path))
        file.close()
        deliver(spool)
    except BaseException:
        spool.discard()
        raise


def _copy_header(source: Sdf.Layer, target: Sdf.Layer, out: Path, parts: list[_Part]) -> None:
    """Copy a part's stage metadata, with the range of all parts if the shot has none of its own."""
    begin, end = min(part.layer.startTimeCode for part in parts), max(part.layer.endTimeCode for part in parts)
    repeat_metadata(source, target, out, {"startTimeCode": begin, "endTimeCode": end})
    for shot in source.subLayerPaths:
        target.subLayerPaths.append(relative(source.ComputeAbsolutePath(shot), out))


def _copy_prim(prim: Sdf.PrimSpec, target: Sdf.Layer) -> None:
    """Copy everything that a part says about a prim, except samples."""
    over = Sdf.CreatePrimInLayer(target, prim.path)
    _copy_info(prim, over)
    for relation in prim.relationships:
        copied = Sdf.RelationshipSpec(over, relation.name, relation.custom)
        copied.targetPathList.ClearEditsAndMakeExplicit()
        copied.targetPathList.explicitItems = list(relation.targetPathList.explicitItems)
    for spec in prim.attributes:
        copied = Sdf.AttributeSpec(over, spec.name, spec.typeName, spec.variability, spec.custom)
        _copy_info(spec, copied, ("typeName", "variability", "custom", "timeSamples"))


def _copy_info(source: Sdf.Spec, target: Sdf.Spec, without=()) -> None:
    for name in sorted(source.ListInfoKeys()):  # USD's own order differs between processes
        if name not in without:
            target.SetInfo(name, source.GetInfo(name))


def _copy_samples(groom: Sdf.Path, sources: dict[float, _Part], file: SampleLayer, frame: float) -> Iterator[float]:
    """Copy the samples of a groom; yields the time codes of the points as they are copied."""
    code, part = next(iter(sources.items()))
    count = len(part.value(groom, code, "points"))
    counts = {"extent": 2, "points": count, "velocities": count}
    for name, code in in_order(list(sources), frame, part.samples_of(groom, "velocities")):
        part = sources[code]
        names = [
            other for other in (["extent", "points"] if name == "points" else [name]) if part.samples_of(groom, other)
        ]
        file.put(groom, code, {other: part.value(groom, code, other, counts[other]) for other in names})
        if name == "points":
            yield code


def _below(prim: Sdf.PrimSpec) -> Iterator[Sdf.PrimSpec]:
    """All prims under one, as a stage has them."""
    for child in prim.nameChildren:
        yield child
        yield from _below(child)


def _prims(parts: list[_Part], stage: Usd.Stage) -> list[Sdf.PrimSpec]:
    """All prims of the parts in the order in which a bake writes them, the stage's; each from the first part that has it."""
    found: dict[Sdf.Path, Sdf.PrimSpec] = {}
    for part in parts:
        for prim in part.prims():
            found.setdefault(prim.path, prim)
    every = stage.Traverse(Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate))
    place = {path: number for number, path in enumerate(prim.GetPath() for prim in every)}
    return sorted(found.values(), key=lambda prim: place.get(prim.path, len(place)))


def _all_gaps(plan: dict[Sdf.Path, dict[float, _Part]], frame: float, stage: Usd.Stage) -> list[str]:
    """The notes on frames of the shot that no part has; one per groom if they differ."""
    found = {groom: _gaps(list(sources), frame, stage) for groom, sources in plan.items()}
    if len({tuple(sources) for sources in plan.values()}) == 1:
        return next(iter(found.values()))
    return few([f"{groom}: {note}" for groom, notes in found.items() for note in notes], "grooms have such gaps")


def _gaps(codes: list[float], frame: float, stage: Usd.Stage) -> list[str]:
    """The notes on frames of the shot that no part has."""
    where = some(gaps(codes, frame, stage))
    return [f"no part has samples {where}"] if where else []
