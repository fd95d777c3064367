# SPDX-License-Identifier: GPL-3.0-or-later
"""Files may be written over only if they were made here: a panel asks nobody before."""

import os

from neuralocks_core.errors import NeuralocksError


def check_ours(paths, made_here) -> None:
    """Refuse to write over files of somebody else's.

    Args:
        paths: of the files to write; some may be there.
        made_here: tells of a path whether the file there was made by Neuralocks.

    Raises:
        NeuralocksError: one was not.
    """
    for path in paths:
        if os.path.isfile(path) and not made_here(path):
            raise NeuralocksError(
                f"{path}: would be written over, and was not made by Neuralocks; choose another file name, or move it away"
            )
