# SPDX-License-Identifier: Apache-2.0
"""`neuralocks demo`: the shipped shot with the shipped model, from bake to picture and report card."""

import time
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from neuralocks_core.arguments import flag
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.evaluation.report import Card
from neuralocks_core.files import as_path, atomic_write
from neuralocks_core.preview.pictures import LacksLibrary
from neuralocks_core.progress import Progress

from ..baking.bake import bake
from ..baking.procedure import BakeResult
from .baked import read_baked
from .evaluate import evaluate
from .picture import preview


@dataclass(frozen=True)
class Demo:
    """What the demo made.

    Attributes:
        shot: the shipped shot.
        bake: what the bake did.
        card: its report card.
        outputs: the files made, name -> path.
        seconds: step -> wall time [s].
        notes: what could not be made, and why.
    """

    shot: Path
    bake: BakeResult
    card: Card
    outputs: dict[str, Path]
    seconds: dict[str, float]
    notes: list[str]


def shipped_shot() -> Path:
    """The shot in the installed package, or in the source tree.

    Raises:
        NeuralocksError: neither holds it.
    """
    package = Path(str(files("neuralocks_core")))
    for folder in (package / "shipped" / "shot", package.parent / "examples" / "shot"):
        if (folder / "shot.usda").is_file():
            return folder / "shot.usda"
    raise NeuralocksError("demo: the shipped shot is missing from this installation; install neuralocks again")


def demo(out, model=None, *, clip: bool = True, progress: Progress | None = None) -> Demo:
    """Bake the shipped shot, measure it and draw it.

    Args:
        out: folder for everything; made if missing.
        model: another model than the shipped one.
        clip: also make the clip.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: something is missing or cannot be written. A missing preview library is only noted.
    """
    out, clip = as_path(out, "out"), flag("--clip", clip)
    shot, seconds, notes = shipped_shot(), {}, []
    outputs = {"bake": out / "demo.usdc"}

    def timed(name: str, work):
        began = time.monotonic()
        result = work()
        seconds[name] = time.monotonic() - began
        return result

    # Without velocities it is half as large, and nothing here draws motion blur.
    result = timed("bake", lambda: bake(shot, outputs["bake"], model, velocities=False, progress=progress))
    baked = read_baked(outputs["bake"])
    card = timed("report card", lambda: evaluate(baked, progress=progress))
    outputs["report card"] = out / "report.json"
    with atomic_write(outputs["report card"]) as part:
        part.write_text(card.to_json() + "\n", encoding="utf-8")
    for name, file in (("picture", "demo.png"), ("clip", "demo.mp4")):
        if name == "clip" and not clip:
            continue
        try:
            outputs[name] = timed(name, lambda file=file: preview(baked, out / file, progress=progress))
        except LacksLibrary as error:
            if str(error) not in notes:  # without the extra, both fail for the same reason
                notes.append(str(error))
    return Demo(shot, result, card, outputs, seconds, notes)
