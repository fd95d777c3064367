# SPDX-License-Identifier: Apache-2.0
"""The camera of a picture."""

from dataclasses import dataclass

import numpy as np

ANGLE = 24.0
"""The camera's vertical field of view [degrees]."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera with the field of view ANGLE.

    Attributes:
        eye, target: (3,) [m].
        up: unit vector (3,).
    """

    eye: np.ndarray
    target: np.ndarray
    up: np.ndarray

    @property
    def axes(self) -> np.ndarray:
        """Rotation (3, 3) whose columns point right, up and towards the eye from the target."""
        back = self.eye - self.target
        back /= np.linalg.norm(back)
        right = np.cross(self.up, back)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(back, right), back], axis=1)

    @property
    def to_eye(self) -> np.ndarray:
        """Unit vector (3,) from the target towards the eye."""
        return self.axes[:, 2]
