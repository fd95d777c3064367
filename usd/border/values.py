# SPDX-License-Identifier: Apache-2.0
"""Values of attributes as arrays. A file may declare an attribute with any type, and USD returns what it finds."""

import numpy as np
from pxr import Usd, Vt

from neuralocks_core.errors import NeuralocksError

SHAPES = {
    "int[]": (-1,),
    "float[]": (-1,),
    "point3f[]": (-1, 3),
    "vector3f[]": (-1, 3),
    "matrix4d": (4, 4),
    "matrix4d[]": (-1, 4, 4),
}
"""Type -> shape, -1 for any number of elements; other types of that shape will do."""


def as_numbers(attribute: Usd.Attribute, wanted: str, value, dtype=float) -> np.ndarray:
    """A value of an attribute as numbers, in the shape of the `wanted` type; empty if it has none.

    Raises:
        NeuralocksError: its type cannot be read as the wanted one.
    """
    shape = SHAPES[wanted]
    try:
        # NaN is no whole number, but a number, also one that signals; what is too large for single precision becomes infinite.
        with np.errstate(invalid="raise" if np.issubdtype(dtype, np.integer) else "ignore", over="ignore"):
            found = np.asarray(() if value is None else value, dtype)
    except (TypeError, ValueError, OverflowError, FloatingPointError):  # names, for example
        raise _unlike(attribute, wanted) from None
    if found.ndim and not len(found):
        found = np.zeros((0, *shape[1:]), dtype)
    if len(found.shape) != len(shape) or any(n not in (-1, m) for m, n in zip(found.shape, shape)):
        raise _unlike(attribute, wanted)
    return found


def as_names(attribute: Usd.Attribute, value) -> tuple[str, ...]:
    """A value of an attribute as names; () if there is none.

    Raises:
        NeuralocksError: it is of another type.
    """
    if isinstance(value, Vt.TokenArray | Vt.StringArray):
        return tuple(map(str, value))
    if value is None or hasattr(value, "__len__") and not len(value):
        return ()
    raise _unlike(attribute, "token[]")


def _unlike(attribute: Usd.Attribute, wanted: str) -> NeuralocksError:
    # For an attribute of a schema USD reports the schema's type, whatever a layer says.
    told = (spec.typeName for spec in attribute.GetPropertyStack())
    own = next((name for name in told if name != wanted), attribute.GetTypeName())
    return NeuralocksError(
        f"{attribute.GetPrimPath()}: its {attribute.GetName()} are {own}, not {wanted}; export it again with that type"
    )
