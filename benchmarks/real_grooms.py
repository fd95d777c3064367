# SPDX-License-Identifier: Apache-2.0
"""Real grooms on the shipped shot, from hair file to report card: how much of each the model gets right.

    python benchmarks/real_grooms.py FILE... [--model MODEL] [--frames A:B] [--train MINUTES [--begin MODEL]]

Files of one folder are parts of one head of hair: they are put on the shot's head together, by matching the sphere through
their roots to the sphere through the roots of the shot's own hair. Then the user's commands run: `neuralocks bake`, and
`neuralocks evaluate --reference`, which simulates 200 strands of each file. With `--train`, a model is trained for each
first, by `neuralocks train` on random motion, and its bake is measured; `--begin nothing` trains from scratch.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import plain_errors  # noqa: F401

from neuralocks_core.groom import Groom
from neuralocks_core.hairstyles.fitting import sphere

SHOT = Path(__file__).resolve().parents[1] / "examples/shot/shot.usda"
COLUMNS = {
    "position_percent": "position",
    "motion_error_median": "motion, median",
    "motion_error_rms": "motion, rms",
    "velocity_error": "velocity",
    "motion_ratio": "motion ratio",
}
INSIDE = {
    "inside_at_rest_percent": "inside at rest %",
    "penetration_percent": "inside %",
    "penetration_3mm_percent": "over 3 mm %",
}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--model", help="the shipped one if left out")
    parser.add_argument("--frames", help="A:B of the shot; all if left out")
    parser.add_argument("--train", type=float, metavar="MINUTES", help="train a model of its own for each file")
    parser.add_argument("--begin", help="with --train: as for `neuralocks train`")
    arguments = parser.parse_args()
    if arguments.begin and not arguments.train:
        parser.error("--begin goes with --train")
    print(
        "| groom | model | strands | length, cm | rigid: position | "
        + " | ".join([*COLUMNS.values(), *INSIDE.values()])
        + " |"
    )
    print("| --- | --- |" + " ---: |" * (3 + len(COLUMNS) + len(INSIDE)))
    training = {"minutes": arguments.train, "begin": arguments.begin} if arguments.train else None
    for row in rows(arguments.files, arguments.model, arguments.frames, training):
        print("| " + " | ".join(v if isinstance(v, str) else f"{v:.3g}" for v in row.values()) + " |", flush=True)


def rows(paths, model=None, frames=None, training: dict | None = None):
    """Yield the numbers of each file, by column; with `training`, those of a model trained for it."""
    from neuralocks_core.deformation.model_choice import suited
    from usd.baking.bake import bake
    from usd.models.train import train
    from usd.review.evaluate import evaluate
    from usd.shot.stage import read_shot

    shot = read_shot(SHOT)
    character = shot.grooms[0].attachment.character
    fitted = on_head(paths, character, character.canonical(roots(shot.grooms[0].groom)))
    with tempfile.TemporaryDirectory() as folder:
        for number, (path, groom) in enumerate(fitted.items()):  # files in different folders may have the same name
            scene = write_scene(Path(folder) / f"{number}.usda", groom, character)
            baked = Path(folder) / f"{number}_hair.usdc"
            if training:
                own = Path(folder) / f"{number}.neuralocks"
                model = train(scene, [], [], own, {"minutes": training["minutes"]}, begin=training["begin"])
            bake(scene, baked, model, frames=frames, velocities=False)
            card = evaluate(baked, reference=True, model=model)
            measured, compared = (next(iter(part.values())) for part in (card.grooms, card.compared))
            yield {
                "groom": path.stem,
                "model": suited(model, character, groom).stem,
                "strands": str(measured["strands"]),
                "length": 100 * float(np.median(lengths(groom))),
                "rigid": compared["rigid"]["position_percent"],
                **{name: compared["bake"][name] for name in COLUMNS},
                **{name: measured[name] for name in INSIDE},
            }


def write_scene(path: Path, groom: Groom, character) -> Path:
    """The shipped shot with another hair, skinned to its head."""
    from pxr import Usd, UsdSkel

    from usd.assets.groom import author_groom
    from usd.assets.prims import bind_rigidly

    stage = Usd.Stage.CreateNew(str(path))
    shipped = Usd.Stage.Open(str(SHOT))
    layers = shipped.GetRootLayer().subLayerPaths
    stage.GetRootLayer().subLayerPaths = [str(SHOT.parent / name) for name in layers if "groom" not in name]
    for key in ("startTimeCode", "endTimeCode", "timeCodesPerSecond", "framesPerSecond", "metersPerUnit", "upAxis"):
        stage.SetMetadata(key, shipped.GetMetadata(key))
    stage.SetDefaultPrim(stage.OverridePrim("/Body"))
    skeleton = UsdSkel.Skeleton(next(prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Skeleton)))
    bind_rigidly(skeleton, author_groom(stage, "/Body/Hair", groom).GetPrim(), np.eye(4), character.head)
    stage.GetRootLayer().Save()
    return path


def on_head(paths, character, scalp: np.ndarray) -> dict[Path, Groom]:
    """Hair files on a character's head, in bind-world metres.

    Args:
        paths: files whose hair stands upright and faces +Z; those of one folder share position and scale.
        character: whose head.
        scalp: (n, 3) canonical roots of hair that covers the scalp [m].
    """
    from neuralocks_core.formats.reading import read

    heads = defaultdict(dict)
    for path in map(Path, paths):
        heads[path.parent][path] = read(path, unit=1.0)
    middle, wanted = sphere(scalp)
    to_bind = character.canonical_to_bind
    result = {}
    for parts in heads.values():
        centre, radius = sphere(np.concatenate([roots(groom) for groom in parts.values()]))
        for path, groom in parts.items():
            points = (groom.points - centre) * (wanted / radius) + middle
            points = (points @ to_bind[:3, :3].T + to_bind[:3, 3]).astype(np.float32)
            result[path] = replace(groom, points=points, widths=np.float32([8e-5]))
    return {path: result[path] for path in map(Path, paths)}


def roots(groom: Groom) -> np.ndarray:
    """First points (S, 3) of the strands."""
    return groom.points[groom.starts[groom.counts > 0]].astype(float)


def lengths(groom: Groom) -> np.ndarray:
    """Arc lengths of the strands (S,) [m]."""
    from neuralocks_core.strands.arclength import arc_lengths

    return arc_lengths(groom)[1]


if __name__ == "__main__":
    main()
