# SPDX-License-Identifier: Apache-2.0
"""The report of a rig model, as training writes it to the model file, in words."""


def report_lines(report: dict) -> list[str]:
    """A line for each thing that the `report` of a `RigModel` says; the keys are those of `training/rig/report.py` and
    `training/rig/motion.py`.
    """
    lines = []
    if "energy" in report:
        e = report["energy"]
        lines.append(
            f"held poses: energy {e['network']:.3f} m^2/s^2, direct optimisation {e['optimised']:.3f}, carried rigidly "
            f"{e['rigid']:.3f}"
        )
    if "tip_error_mm" in report:
        off = report["tip_error_mm"]
        lines.append(
            f"held poses: tips {off['network']:.0f} mm from where direct optimisation has them (carried rigidly "
            f"{off['rigid']:.0f} mm)"
        )
    if "most_turned" in report:
        turned = report["most_turned"]
        line = f"held poses: no joint is turned more than '{turned['joint']}', by {turned['degrees']:.0f} degrees on average"
        lines.append(
            line
            + (
                "; if it stands out and many chains fan out below it, name these with --chains, else train with another --seed"
                if turned["degrees"] > 60
                else ""
            )
        )
    for name, words in (("network", "network"), ("optimised", "direct optimisation"), ("rigid", "carried rigidly")):
        if f"penetration_{name}" in report:
            p = report[f"penetration_{name}"]
            lines.append(
                f"inside the body, {words}: {p['percent']:.2f} % of vertices, at most {p['worst_mm']:.1f} mm "
                f"in {p['poses']} poses"
            )
    for name, error in report.get("motion_error", {}).items():
        line = f"in motion, {name}: error against the simulation {error:.3f} (carried rigidly 1)"
        if name in report.get("motion_depth", {}):
            depth = report["motion_depth"][name]
            line += f"; {depth['percent']:.2f} % of vertices in the body, at most {depth['worst_mm']:.1f} mm"
        if name in report.get("rates", {}):
            rates = ", ".join(f"{gap} mm off at {rate}" for rate, gap in report["rates"][name].items())
            jump, cost = report["teleport"][name], report["cost"][name]
            line += f"; {rates} from 60 fps; a teleport flings it {jump['flung_mm']} mm for {jump['seconds']} s"
            line += f"; {_work(cost)} and {cost['bytes_carried_on']} bytes an avatar"
        lines.append(line)
    return lines


def _work(cost: dict) -> str:
    history = cost["history_multiply_adds"]
    of = f" of the network and {history} of the history" if history else ""
    return f"{cost['multiply_adds']} multiply-adds{of}"
