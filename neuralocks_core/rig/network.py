# SPDX-License-Identifier: Apache-2.0
"""The tiny network of rigged mesh hair: its inputs, its outputs and its file (paper section 4.4: two
layers of 16).

It reads neck and upper chest relative to the head (the first two columns of each rotation), gravity in the
head's frame and, in the dynamic variant, the history of effective gravity and angular velocity. It gives one
bounded rotation per hair joint, in the joint's own bind axes, and exactly none for the bind pose at rest.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from neuralocks_core.arguments import number_array
from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError, about
from neuralocks_core.models import model_file
from neuralocks_core.motion import Clip
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.kinematics import half_turns
from neuralocks_core.wind import Wind

DYNAMIC_BINS = (1,) * 6 + (2,) * 4 + (3,) * 4 + (4,) * 2 + (6,) * 2
"""46 steps of 1/30 s: a second and a half, finest for the newest ones."""
POSE = 15
"""Numbers of the pose and of gravity's direction; the history follows."""
LARGEST = 1e15
"""Numbers up to this have squares that single precision can hold."""
MAX_ANGLE = 2.4
"""Largest turn of a joint [rad] in trained models."""
_CHUNK = 1024


def rig_spec(dynamic: bool = False) -> BoundarySpec:
    """The network's inputs from the body."""
    bins = DYNAMIC_BINS if dynamic else ()
    return BoundarySpec(bins=bins, pose_joints=("neck", "upper_chest"), chest=False, taper=0.3)


def feature_columns(spec: BoundarySpec) -> np.ndarray:
    """Which numbers of the boundary vector the network reads: pose 12, gravity 3, history 6 per bin."""
    parts = spec.slices
    return np.concatenate([np.arange(parts[n].start, parts[n].stop) for n in ("pose", "gravity", "history")])


@dataclass(frozen=True)
class RigModel:
    """A trained network for the hair chains of one rig.

    Attributes:
        chains: the joints that it moves.
        spec: what it reads of the body.
        layers: weights (out, in) and biases (out,) float32 in SI units; ReLU between them.
        limits: limit on the magnitude of each input, (F,).
        max_angle: largest turn of a joint [rad].
        training, report, credits: the model card.
    """

    chains: HairChains
    spec: BoundarySpec
    layers: tuple[tuple[np.ndarray, np.ndarray], ...] = field(repr=False)
    limits: np.ndarray = field(repr=False)
    max_angle: float = MAX_ANGLE
    training: dict = field(default_factory=dict)
    report: dict = field(default_factory=dict)
    credits: list = field(default_factory=list)

    def __post_init__(self):
        with np.errstate(over="ignore"):  # what is too large becomes infinite, which is refused
            layers = tuple((np.asarray(w, np.float32), np.asarray(b, np.float32)) for w, b in self.layers)
            object.__setattr__(self, "limits", np.asarray(self.limits, np.float32))
        object.__setattr__(self, "layers", layers)
        size = self.inputs
        if not layers:
            raise NeuralocksError("model: it has no layers; get an undamaged copy")
        sane = (self.limits >= 0) & np.isfinite(self.limits)
        if self.limits.shape != (size,) or not sane.all() or not 0 < self.max_angle < 3.1:
            raise NeuralocksError("model: its input limits do not fit its inputs; get an undamaged copy")
        reach = self.limits.astype(float)  # the largest that each number can be
        for weight, bias in layers:
            if weight.ndim != 2 or weight.shape[1] != size or bias.shape != weight.shape[:1]:
                raise NeuralocksError("model: its layers do not fit together; get an undamaged copy")
            if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
                raise NeuralocksError("model: NaN or infinity in its weights; get an undamaged copy")
            size = len(weight)
            reach = np.abs(weight.astype(float)) @ reach + np.abs(bias)
            if reach.max(initial=0.0) > LARGEST:
                raise NeuralocksError("model: its weights are too large to compute with; get an undamaged copy")
        if size != 3 * len(self.chains):
            raise NeuralocksError("model: it does not give three numbers per hair joint; get an undamaged copy")

    @property
    def inputs(self) -> int:
        """Length of the feature vector."""
        return len(feature_columns(self.spec))

    @property
    def hidden(self) -> int:
        """Width of the first hidden layer."""
        return len(self.layers[0][1])

    @property
    def dynamic(self) -> bool:
        """Whether it reads a history."""
        return bool(self.spec.bins)

    @property
    def feels_wind(self) -> bool:
        """Whether wind moves its hair."""
        return self.spec.feels_wind

    def evaluate(self, features: np.ndarray) -> np.ndarray:
        """Turns of all hair joints for one avatar (F,) or a batch (B, F).

        Args:
            features: as from `RigSampler.features` or the exported header; any values are allowed.

        Returns:
            unit quaternions (N, 4) or (B, N, 4) wxyz float32 in the joints' bind axes: local rotation = bind
            local rotation * q.

        Raises:
            NeuralocksError: these are no numbers, or not as many as the model reads.
        """
        features = self._features(features)
        rows = np.atleast_2d(features)
        result = np.empty((len(rows), len(self.chains), 4), np.float32)
        for start in range(0, len(rows), _CHUNK):  # stays in the processor's cache
            raw = self._raw(rows[start : start + _CHUNK]).reshape(-1, len(self.chains), 3)
            _bounded(raw, np.float32(np.sin(self.max_angle / 2)), result[start : start + _CHUNK])
        return result[0] if features.ndim == 1 else result

    def _features(self, given) -> np.ndarray:
        """(F,) or (B, F) float32; numbers too large for it are beyond the limits anyway."""
        wanted = f"{self.inputs} numbers per avatar, ({self.inputs},) or (B, {self.inputs})"
        features = number_array("features", given, wanted, np.float32)
        if features.ndim not in (1, 2) or features.shape[-1] != self.inputs:
            raise NeuralocksError(f"features: are of shape {features.shape}; this model reads {wanted}")
        return features

    def _raw(self, rows: np.ndarray) -> np.ndarray:
        (weight, bias), *others = self.layers
        # Over a hundred large terms: in single precision their order would matter, and it differs between libraries.
        value = np.fmin(np.fmax(rows, -self.limits), self.limits)  # NaN becomes the lower limit, as in the header
        value = value.astype(float) @ weight.T.astype(float)
        value = (value + bias).astype(np.float32)
        for weight, bias in others:
            np.maximum(value, 0, out=value)
            value = value @ weight.T
            value += bias
        return value

    def canonical_turns(self, features: np.ndarray) -> np.ndarray:
        """Turns (B, N, 4) wxyz float64 in canonical axes for features (B, F); errors as in `evaluate`."""
        raw = self._raw(np.atleast_2d(self._features(features))).reshape(-1, len(self.chains), 3).astype(float)
        return half_turns(np.einsum("nij,bnj->bni", self.chains.axes, raw), self.max_angle)

    def save(self, path) -> Path:
        """Write the one-file model, with its ONNX graph."""
        from neuralocks_core.rig.graph import rig_graph

        meta = {
            "kind": "rig",
            "boundary": self.spec.to_json(),
            "chains": self.chains.to_json(),
            # The shortest text that reads back to the same float32.
            "layers": [[_numbers(weight), _numbers(bias)] for weight, bias in self.layers],
            "limits": _numbers(self.limits),
            "max_angle": self.max_angle,
            "training": self.training,
            "report": self.report,
            "credits": self.credits,
        }
        return model_file.write(path, meta, {"rig.onnx": rig_graph(self)})

    @classmethod
    def load(cls, path=None) -> "RigModel":
        """Read a model file; the shipped one if none is named.

        Raises:
            NeuralocksError: it is missing, damaged, of a later format or not a model of mesh hair.
        """
        path = model_file.shipped("rig") if path is None else path
        meta = model_file.read(path, "rig").meta
        with about(path):
            return cls._of(meta)

    @classmethod
    def _of(cls, meta: dict) -> "RigModel":
        try:
            return cls(
                layers=meta["layers"],
                limits=meta["limits"],
                chains=HairChains.from_json(meta["chains"]),
                spec=BoundarySpec.from_json(meta["boundary"]),
                max_angle=float(meta["max_angle"]),
                **{name: meta[name] for name in ("training", "report", "credits")},
            )
        except NeuralocksError:
            raise
        except KeyError as error:
            raise NeuralocksError(f"its description lacks {error}; get an undamaged copy") from None
        except (TypeError, ValueError, AttributeError, OverflowError):  # whose own messages mean nothing to a user
            raise NeuralocksError("its description is unreadable; get an undamaged copy") from None


class RigSampler:
    """What a rig model reads about one character in one clip, at any time: independent of the clip's rate and the order of calls.

    Args:
        spec: what is read.
        character: skeleton and head.
        clip: its motion.
    """

    def __init__(self, spec: BoundarySpec, character: Character, clip: Clip):
        # The network does not read the body's shape: measuring it would be most of the work.
        self._sampler = BoundarySampler(spec, replace(character, body=None), clip)
        self._columns = feature_columns(spec)

    def features(
        self, times, strength: float = 1.0, joints: np.ndarray | None = None, wind: Wind | None = None
    ) -> np.ndarray:
        """Features (n, F) float32 at times (n,) [s]; the arguments are those of `BoundarySampler.vectors`."""
        return self._sampler.vectors(times, strength=strength, joints=joints, wind=wind)[:, self._columns]


def held_features(spec: BoundarySpec, relative: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Features (n, F) float32 of held poses.

    Args:
        spec: what the network reads; its history stays zero.
        relative: rotations of neck and upper chest relative to the head, from the bind pose, canonical axes, (n, 2, 3, 3).
        gravity: its direction in the head's frame, (n, 3).
    """
    result = np.zeros((len(relative), len(feature_columns(spec))), np.float32)
    result[:, : POSE - 3] = np.swapaxes(relative[..., :2], -1, -2).reshape(len(relative), -1)
    result[:, POSE - 3 : POSE] = gravity
    return result


def input_limits(spec: BoundarySpec) -> np.ndarray:
    """Largest sensible magnitude of each input (F,): larger values, as from a faulty caller, are clipped."""
    # The sampler lists the bins one after another, each with effective gravity [g], then angular velocity [rad/s].
    one = [BoundarySampler.GRAVITY_LIMIT] * 3 + [BoundarySampler.SPIN_LIMIT] * 3
    history = np.tile(one, len(spec.bins))
    return np.concatenate([np.full(POSE, 1.25), history]).astype(np.float32)


def _bounded(raw: np.ndarray, size: np.float32, out: np.ndarray) -> None:
    """`half_turns` in float32, an axis at a time: numpy is slow on rows of three."""
    axes = np.moveaxis(raw, -1, 0)
    square = axes[0] * axes[0]
    for axis in axes[1:]:
        square += axis * axis
    square += 1
    scale = size / np.sqrt(square)
    for place, axis in enumerate(axes, 1):
        np.multiply(axis, scale, out=out[..., place])
    # 1 - |v|^2 without cancellation: |v|^2 = s^2 (1 - 1 / (1 + |raw|^2)).
    np.sqrt((1 - size * size) + size * size / square, out=out[..., 0])


def _numbers(values: np.ndarray) -> list:
    rounded = [float(str(v)) for v in np.asarray(values, np.float32).ravel()]
    return np.asarray(rounded).reshape(np.shape(values)).tolist()
