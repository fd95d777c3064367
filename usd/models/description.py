# SPDX-License-Identifier: Apache-2.0
"""What another runtime needs to know about a model: its graphs, how to make its input, what its sliders do."""

import numpy as np

from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.boundary.stepped import LONGEST
from neuralocks_core.deformation.clumping import CANTILEVER
from neuralocks_core.errors import about
from neuralocks_core.materials import RANGES, Material
from neuralocks_core.measures import MEASURES
from neuralocks_core.models import model_file
from neuralocks_core.models.network_sizes import CODE, HIDDEN, PLAIN_STRAND, SHAPE, STRAND, K
from neuralocks_core.models.runtime import graph_session
from neuralocks_core.motion import G
from neuralocks_core.wind import ACROSS, FREQUENCIES, PHASES, SHARES

from ..border.units import FASTEST, SLOWEST
from ..skel.clip_codes import ALONE, CLOSE, SAME, STAND, STEP

UNITS = "SI units, float32; canonical space: origin at the head joint, Y up, the bind pose faces +Z"


def _listed(values) -> str:
    return ", ".join(f"{value:g}" for value in values)


GRAPHS = {
    "encoder.onnx": f"once per groom: `shape` (S, {SHAPE}), root-relative points of {K} vertices in scalp axes [m] "
    f"-> `code` (S, {CODE})",
    "strand.onnx": f"once per groom: `strand` (S, {PLAIN_STRAND} or {STRAND}): root UV 2, own code {CODE}, mean code of its lock {CODE}, root normal 3, "
    f"length 1 [m], and if it reads {STRAND}, rest points from the root {SHAPE} [m, canonical space] -> `strand_part` (S, {HIDDEN})",
    "frame.onnx": f"once per frame: `frame` (1, F), the boundary vector -> `frame_part` (1, {HIDDEN}), and if the frame "
    f"changes later weights, `middle` ({HIDDEN}, {HIDDEN}) and `out` ({HIDDEN}, {SHAPE})",
    "tail.onnx": f"per strand and frame: `strand_part` (S, {HIDDEN}), all outputs of `frame.onnx`, `anchor` (S, {SHAPE}): the `offsets` "
    f"for the held bind pose (zeros if the model is not anchored), `edges` (S, {SHAPE}): rest[i] - rest[i-1] "
    f"with row 0 zero [m] -> `offsets` (S, {SHAPE}), `displacement` (S, {SHAPE}) in canonical space [m]",
    "rig.onnx": "`features` (B, F) of B characters -> `turns` (B, joints, 4) wxyz, joints as in the model's `chains`: local "
    "rotation now = local rotation in the bind pose * turn. The first layer is summed in float64 inside. The C header of `neuralocks "
    "rig export-c` also computes the features",
}

_STEPS = {
    "f_k": "a_k = (p(t_k) - 2 p(t_k+1) + p(t_k+2)) / dt^2; f_k = T(R_head(t_k)) (g - a_k) / 9.81 - gravity, no longer "
    f"than {BoundarySampler.GRAVITY_LIMIT:g}",
    "v_k": f"v_k = T(R_head(t_k)) (p(t_k) - p(t_k+1)) / dt, no longer than {BoundarySampler.SPEED_LIMIT:g}",
    "s_k": "s_k = T(R_head(t_k)) r / dt with r the rotation vector of R_head(t_k) T(R_head(t_k+1)), no longer than "
    f"{BoundarySampler.SPIN_LIMIT:g}",
    "c_k": "c_k the same for the upper chest, also in the head's axes",
}
"""What a step of the history may consist of."""
_CLIP = (
    "the samples that a bake reads of a shot's motion: those of the skeleton's animation, and of those of its parents' transforms the ones "
    f"between two of these that are farther apart than {CLOSE:g} s, {STAND:g} s or more before the first, or after the last (all, if the "
    "animation moves no joint). The "
    f"shot's range adds its end if that lies after the last of them, and its start if that lies {STAND:g} s or more before "
    "the first, or if an exporter left out a hold there (the animation's layer begins before its first sample, whose value is the default "
    "value, too): the character stands still in between. Between two "
    f"samples farther apart than {CLOSE:g} s, each frame is a sample, too, as USD interpolates there: a frame is a whole time code, "
    f"or, if these are fewer than {SLOWEST:g} or more than {FASTEST:g} a second and framesPerSecond differs, 1 / framesPerSecond "
    f"seconds, counted from the first sample. Of samples nearer to each other than {SAME:g} frames the last one counts, as does the later of the two sides of a "
    f"step, which are less than {STEP:g} frames apart and more than {ALONE:g} times as far from the samples around them; no frame less than "
    f"{STEP:g} frames before a step is a sample"
)
_BLOWS = (
    " The spline goes through the places of the samples, except where the velocity from sample to sample, (p_i+1 - p_i) / "
    "(t_i+1 - t_i), changes at a sample by a vector longer than "
    f"{BoundarySampler.GRAVITY_LIMIT:g} * 9.81 max((t_i+1 - t_i-1) / 2, dt): there the change is shortened to that length, "
    "and the path continues from there. A loop stays as it is."
)
_SPACES = "(3, 3), without scale: columns made of unit length, and the nearest rotation if they are sheared; world: metres, Y up; g = (0, -9.81, 0); T(m) is the transpose of m"
_PLACE = "the place of the head joint"
_STRAND_PLACE = _PLACE + " (for hair carried by a joint below it: that of `canonical_to_head`'s origin)"

_WIND = (
    "add the binned steps of T(R_head(t_k)) w(t_k) / 9.81 to those of f_k, with w(t) the acceleration of hair by the wind [m/s^2, "
    "world]; motion strength does not scale them. In a bake, w = m + gusts (a m + b s), with m its wind, s a "
    f"level vector {ACROSS:g} times as long as m, towards (m.z, 0, -m.x), or +X if m is vertical, "
    f"a and b the sums of c sin(2 pi f t + phase), c {_listed(SHARES)}, f {_listed(FREQUENCIES)} Hz, phases {_listed(PHASES[0])} and "
    f"{_listed(PHASES[1])} rad; in a loop, each f is rounded to whole turns in its length, one at least"
)
_CUT = (
    "where a character jumps to another place, hair starts anew: the cut is the first sample of a new clip, before which the "
    "head moves in a straight line and does not turn. The sample before it is the last of the previous clip, after which the head "
    "stands still. A bake finds cuts, or is given them (`--cuts`)"
)


def _game(kept: str) -> str:
    return (
        f"the clip is the motion so far: keep the samples of the last {kept} seconds. Add one whenever the animation "
        "has been updated, with the time of that pose, and ask for the newest one's time: frames drawn between two updates would "
        "look like stops. Add no pose that is not finite. Keep times in double. Clear the samples at a cut: with a single sample, "
        "the head stands still"
    )


STRAND_INPUT = {
    "spaces": "R_j(t) = rotation of joint j in the world at t * inverse(its `bind`) * inverse(`facing`), " + _SPACES,
    "pose": "for each pose joint: column 0, then column 1, of T(R_head) R_j stance_j; stance is 1 except for upper arms",
    "gravity": "T(R_head(t)) g / 9.81",
    "shape": "ten lengths of the bind body [m], as in `held`",
    "material": f"logarithm of bend / ({Material.bend:g} weight); 0; that of damping / ({Material.damping:g} sqrt(weight)); 0, because clumping is not "
    "an input",
    "clip": _CLIP,
}
"""How each part of the boundary vector is made, except the history (`_history`)."""

RIG_INPUT = {
    "spaces": "R_j(t) = rotation of joint j in the world at t * inverse(that in the bind pose), both turned about Y so that the "
    "bind pose faces +Z (+X from the right upper arm to the left), " + _SPACES,
    "joints": "head, neck and upper chest; `training.reads` of the model says which these were in its rig. The head stands for "
    "a joint that a rig does not have",
    "pose": "for neck and upper chest: column 0, then column 1, of T(R_head) R_j",
    "gravity": STRAND_INPUT["gravity"],
    "clip": _CLIP,
    "hats": "if a bone between the head and some chains moves on the head, as a hat's does, evaluate once more with that bone's "
    "rotation as the head's, and take those chains' turns from there. It needs its own history, with p the place to which "
    "that bone carries the head's joint",
    "turns": "in the axes that each joint has in the model's rig: B, its row of `chains.axes`, is its world rotation in the bind "
    "pose that faces +Z. With J your joint's own there and D = T(J) B, the turn (w, v) becomes (w, det(D) D v)",
}
"""How the features of a rig model are made, except the history (`_history`), and how to use its output."""

SLIDERS = {
    "bend, weight, damping": "bend is what bakes and Blender call stiffness. "
    + ", ".join(f"{name} goes from {low:g} to {high:g}" for name, (low, high) in RANGES.items())
    + ", motion strength from 0 to 4. They change `material` in the boundary vectors and in `held`; if the model is anchored, then compute "
    "`anchor` again, once: `offsets` of tail.onnx with `anchor` zero and the frame `held`",
    "weight": "in the history, t_k = t - k dt / sqrt(weight), divisions by dt stay; divide what wind adds by weight",
    "motion strength": "a factor of `history`: 0 is each pose as if held, 1 as trained",
    "wind": _WIND,
    "clumping": f"scales how far a strand strays from its lock, by f = (k0 + {2 * Material.clumping:g} tie) / (k0 + 2 clumping tie), k0 = {CANTILEVER:g} bend / length^4 "
    f"+ {G:g} weight / length; {Material.clumping:g} changes nothing. D is the displacement of each strand, and L the mean of it over "
    "the `valid` strands with the same `lock`. With vertices 0 and 1 at rest, each vertex follows the one before by an edge: rest edge + what L + f (D - L) adds to "
    'it, scaled to the length that the edge has with D: its rest length, unless the model\'s `output` is "displacement"',
    "a game": _game("(steps + 2) dt / sqrt(weight)"),
    "blend shapes": "roots and `shape` here are those of the clip's first sample. If the animation changes blend shapes, a bake "
    "moves roots with the skin below them, and measures `shape` again in each frame",
    "a cut": _CUT,
    "the body": "nothing here keeps strands out of it: that is a separate step of the bake (`--no-resolve` leaves it out)",
}
"""What an artist or a game changes, and its effect on the inputs and outputs above."""


def described(file: model_file.ModelFile) -> dict:
    """The content of `description.json`, except for a shot's grooms."""
    with about(file.path):
        spec = BoundarySpec.from_json(file.meta.get("boundary"))
    training = {name: value for name, value in file.meta["training"].items() if name not in ("curve", "hair")}
    result = {"units": UNITS, "graphs": _graphs(file)}
    if file.kind == "strands":
        result["boundary vector"] = {
            **_input(spec, list(spec.slices), STRAND_INPUT, _STRAND_PLACE),
            "pose joints": spec.pose_joints,
            "shape": MEASURES,
        }
        result["sliders"] = {
            name: how
            for name, how in SLIDERS.items()
            if name != "wind" or (spec.feels_wind and file.meta.get("static") is not True)
        }
    else:
        result["features"] = _input(spec, ["pose", "gravity", "history"], RIG_INPUT, _PLACE)
        how = result["features"]["how"]
        if spec.bins:
            how["history"] += ". Motion strength is a factor of it: 0 is each pose as if held, 1 as trained"
            how |= {"a cut": _CUT, "a game": _game("(steps + 2) dt")}
        else:  # a pose has no history
            del how["history"], how["clip"]
        if spec.feels_wind:
            how["wind"] = _WIND
    # Layers are the weights, which rig.onnx has; what was measured is for people, and `inspect` tells it.
    meta = {name: value for name, value in file.meta.items() if name not in ("layers", "report")}
    return result | {"model": meta | {"training": training}}


def _input(spec: BoundarySpec, parts: list[str], how: dict, place: str) -> dict:
    """Positions of the parts of the boundary vector that a network reads, in order, and how they are made."""
    sizes = [spec.slices[name].stop - spec.slices[name].start for name in parts]
    ends = np.cumsum(sizes).tolist()
    return {
        "length": ends[-1],
        "parts": {name: [end - size, end] for name, size, end in zip(parts, sizes, ends, strict=True)},
        "steps": spec.steps,
        "bin weights": [float(weight) for weight in spec.bin_weights],
        "how": how | {"history": _history(spec, place)},
    }


def _history(spec: BoundarySpec, place: str) -> str:
    """How the history of such a boundary vector is made, and from which point of the head."""
    linear = {"gravity": ["f_k"], "velocity": ["v_k"], "none": []}[spec.linear]
    steps = [*linear, "s_k", *["c_k"] * spec.chest]
    return (
        f"step k = 0 ... steps - 1 is {', '.join(steps)}, three numbers each. With p {place} and t_k = t - k dt: "
        f"{'; '.join(_STEPS[step] for step in steps)}. A bin is the mean over as many steps as `bins` says, newest first, times "
        "its `bin weights`. In a held pose all is 0. Between the samples of `clip`, p and R in the history follow a "
        "natural cubic spline through them, of the place and of the quaternion's components with continuous signs; `pose` and `gravity` are of the "
        f"pose that is drawn.{_BLOWS if linear == ['f_k'] else ''} In animation on twos to fours, whose poses (of the joints that are read; if these hold none in the world, as seen "
        "from the upper chest) are held for two to four samples each, "
        "samples that repeat a pose are left out, and at their times t is that of the pose's first sample (between two samples, t goes linearly "
        "from one to the other; after the last one, on with time). A pose that shows for longer than "
        f"1/{1 / LONGEST:.0f} s is a stop, whose samples stay, but for the end of one that held poses follow: of its last m samples only the first "
        "stays, m being how many the next pose has. (A bake looks at four poses in a row: three must be held, and each differ "
        "clearly from the one before.) In a loop, the last pose, if it is held, counts at its last sample. Before the first sample "
        "the head moves in a straight line, with its velocity there, and does not turn; after the last it stands still. In a loop (`--loop`), "
        "t wraps round, with the head ahead by its path in each round, and the spline continues over the seam on both sides"
    )


def _graphs(file: model_file.ModelFile) -> dict:
    result = {}
    for name in file.graphs:
        session = graph_session(file, name)
        result[name] = {
            "what": GRAPHS[name],
            "inputs": {i.name: i.shape for i in session.get_inputs()},
            "outputs": {o.name: o.shape for o in session.get_outputs()},
        }
    return result
