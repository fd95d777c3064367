# SPDX-License-Identifier: Apache-2.0
"""Arguments that are either true or false."""

import numpy as np

from neuralocks_core.errors import NeuralocksError


def flag(name: str, given) -> bool:
    """What a caller gives for an argument that is either true or false. Words are refused, for Python counts 'false' as true.

    Raises:
        NeuralocksError: it is neither; the message begins with the argument's name.
    """
    if not isinstance(given, bool | np.bool_):
        raise NeuralocksError(f"{name} {given!r}: must be True or False")
    return bool(given)
