# SPDX-License-Identifier: Apache-2.0
"""The report card: measurements of hair as text, numbers and curves."""

import io
import json
import math
import os
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import atomic_write, check_writable
from neuralocks_core.json_values import plain

LABELS = {
    "stretch_percent": ("length error, mean", "%", "of a strand's rest length, in head space"),
    "stretch_percent_max": ("length error, largest", "%", ""),
    "stretch_cm": ("stretch violation", "cm", "mean over strands"),
    "penetration_percent": ("vertices in the body", "%", "deeper than at rest"),
    "penetration_3mm_percent": ("deeper than 3 mm", "%", ""),
    "penetration_frames": ("these are of", "frames", "evenly over the bake"),
    "penetration_worst_mm": ("worst depth", "mm", "of all frames"),
    "inside_at_rest_percent": ("inside already at rest", "%", "as the groom was made"),
    "droop_cm": ("droop", "cm", "tips below the rigid groom's, mean"),
    "speed_cm_s": ("speed relative to the head", "cm/s", "mean; rigid hair has 0"),
    "swing_percent": ("swing of the tips", "%", "of strand length (of a coil's line), rms"),
    "settling_s": ("settling after a stop", "s", "until 10 % of the tips' peak speed, or 1 cm/s"),
    "jitter_mm": ("jitter in a held pose", "mm", "largest step of a vertex, 2 s after the stop"),
    "turn_degrees": ("turn from edge to edge", "deg", "mean; much above that at rest is crinkled"),
    "turn_at_rest_degrees": ("the same at rest", "deg", ""),
    "energy_gravity": ("gravity energy", "J/kg", "relative to the rigid groom; below 0 it hangs lower"),
    "energy_bend": ("bend energy", "J/kg", ""),
    "energy_stretch": ("stretch energy", "J/kg", ""),
    "position_percent": ("position error", "% L", "mean over vertices; L as above"),
    "tip_percent": ("position error of the tips", "% L", "mean"),
    "motion_error_median": ("motion error, median strand", "", "rigid = 1"),
    "motion_error_p95": ("motion error, 95th percentile", "", "one strand in 20 has more"),
    "motion_error_rms": ("motion error, rms", "", "rigid = 1"),
    "velocity_error": ("velocity error", "", "rigid = 1"),
    "motion_ratio": ("motion ratio", "", "1 = as lively as the reference"),
    "dynamic_frames": ("consecutive dynamic samples", "", "at 35 % of the reference's motion or more"),
    "tip_correlation": ("tip curve correlation", "", ""),
}
"""Name of a measure -> label, unit, remark."""

BADNESS = {
    "motion_ratio": lambda ratio: abs(ratio - 1),
    "dynamic_frames": lambda count: -count,
    "tip_correlation": lambda correlation: -correlation,
}
"""How bad a value of a measure is, if the one farthest from 0 is not the worst."""

EACH = 8
"""Up to this many grooms each get their own tables; if there are more, one table has mean and worst, and this many are drawn."""

PLOTS = (".png", ".svg", ".pdf")
"""File name extensions that `Card.plot` writes."""


@dataclass(frozen=True)
class Card:
    """The results of an evaluation.

    Attributes:
        title: what was measured.
        grooms: groom -> measures, plain numbers (NaN if there is nothing to measure) and facts in words.
        compared: groom -> whose hair ("bake", "held pose", "rigid") -> measures; empty without reference.
        curves: groom -> {"times": (T,), whose hair: mean tip displacement (T, 3) [m]}.
        notes: facts that a reader should know, one line each.
    """

    title: str
    grooms: dict[str, dict]
    compared: dict[str, dict[str, dict]] = field(default_factory=dict)
    curves: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def to_json(self) -> str:
        """The numbers, for machines; what could not be measured is null."""
        body = {"title": self.title, "grooms": self.grooms, "compared": self.compared, "notes": list(self.notes)}
        return json.dumps(plain(body, digits=8), indent=2, sort_keys=False)

    def text(self, encoding: str | None = "utf-8") -> str:
        """The card for people, in characters of `encoding`; others, such as frame corners or letters of a name, are replaced."""
        from rich.console import Console

        encoding = encoding or "utf-8"
        page = io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors="backslashreplace", newline="\n")
        console = Console(file=page, width=100, force_terminal=False, highlight=False)
        if len(self.grooms) > EACH:
            console.print(self._overview(f"{len(self.grooms)} grooms", self.grooms))
            bakes = {name: rows["bake"] for name, rows in self.compared.items() if "bake" in rows}
            if bakes:
                console.print(self._overview(f"{len(bakes)} grooms, against the reference", bakes))
            console.print("- each groom's own numbers are in --json", markup=False)
        for name, values in self.grooms.items() if len(self.grooms) <= EACH else ():
            console.print(self._measures(name, values))
            if self.compared.get(name):
                console.print(self._comparison(name))
        for note in self.notes:
            console.print(f"- {note}", markup=False)
        page.flush()
        return page.buffer.getvalue().decode(encoding).rstrip() + "\n"

    def plot(self, path: str | os.PathLike) -> Path:
        """Draw the tip curves, one row for each of the grooms with most strands: sideways, up and forward over time.

        Args:
            path: the file to write; its extension, one of PLOTS, chooses the format.

        Raises:
            NeuralocksError: as `check_plot` does, or the file cannot be written.
        """
        path = check_plot(path)
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        drawn = sorted(self.curves, key=lambda name: -self.grooms[name].get("strands", 0))[:EACH]
        figure = Figure(figsize=(12, 2.9 * max(len(drawn), 1)), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(max(len(drawn), 1), 3, squeeze=False, sharex="row")
        style = {
            "reference": {"color": "black", "lw": 2.2},
            "bake": {"color": "tab:red", "lw": 1.6},
            "held pose": {"color": "tab:blue", "lw": 1, "ls": "--"},
            "rigid": {"color": "0.6", "lw": 1, "ls": ":"},
        }
        for row, name in zip(axes, drawn, strict=False):
            curves = self.curves[name]
            for axis, (panel, direction) in enumerate(zip(row, ("sideways", "up", "forward"), strict=True)):
                for who, curve in curves.items():
                    if who != "times":
                        panel.plot(curves["times"], 100 * curve[:, axis], label=who, **style.get(who, {}))
                panel.set_title(f"{name}: tips, {direction}", fontsize=9)
                panel.set_xlabel("s")
                panel.set_ylabel("cm relative to the head")
            row[0].legend(fontsize=8)
        with atomic_write(path) as part:
            figure.savefig(part, dpi=110, format=path.suffix.lower()[1:])
        return path

    def _measures(self, name, values):
        from rich.table import Table

        facts = ", ".join(f"{key} {value}" for key, value in values.items() if key not in LABELS)
        table = Table(title=f"{name}  ({facts})" if facts else name, title_justify="left", show_header=False)
        for key, value in values.items():
            if key in LABELS:
                label, unit, remark = LABELS[key]
                table.add_row(label, _number(value), unit, remark)
        return table

    def _overview(self, title, grooms):
        """For each measure, the mean over the grooms, in which every strand counts equally, and the worst groom."""
        from rich.table import Table

        table = Table(title=title, title_justify="left")
        for heading in ("", "mean", "worst", "", "in"):
            table.add_column(heading, justify="right" if heading in ("mean", "worst") else "left")
        for key, (label, unit, _) in LABELS.items():
            found = {name: values[key] for name, values in grooms.items() if _finite(values.get(key))}
            if found:
                bad = BADNESS.get(key, abs)
                worst = max(found, key=lambda name: bad(found[name]))
                strands = [self.grooms[name].get("strands", 1) for name in found]
                mean = np.average(list(found.values()), weights=strands)
                table.add_row(label, _number(mean), _number(found[worst]), unit, worst)
        return table

    def _comparison(self, name):
        from rich.table import Table

        rows = self.compared[name]
        table = Table(title=f"{name}, against the reference", title_justify="left")
        table.add_column("")
        for who in rows:
            table.add_column(who, justify="right")
        table.add_column("")
        for key, (label, unit, remark) in LABELS.items():
            if any(key in values for values in rows.values()):
                cells = [_number(values[key]) if key in values else "" for values in rows.values()]
                table.add_row(f"{label} {unit}".strip(), *cells, remark)
        return table


def check_plot(path: str | os.PathLike) -> Path:
    """The path, if `Card.plot` can draw such a file: check it before a long measurement, not after.

    Raises:
        NeuralocksError: the extension is unknown, the path is a folder or cannot be written, or matplotlib is missing.
    """
    path = Path(path)
    if path.suffix.lower() not in PLOTS:
        raise NeuralocksError(f"{path}: unknown kind of picture; end it in {', '.join(PLOTS)}")
    if find_spec("matplotlib") is None:
        raise NeuralocksError(f'{path}: matplotlib is not installed; pip install "neuralocks[compare]"')
    check_writable(path)
    return path


def _finite(value) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and math.isfinite(value)


def _number(value) -> str:
    if not isinstance(value, (int, float, np.integer, np.floating)):
        return str(value)
    if not math.isfinite(value):
        return "-"
    if isinstance(value, (int, np.integer)) or value == 0:
        return str(int(value))
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
