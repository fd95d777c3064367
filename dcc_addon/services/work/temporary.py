# SPDX-License-Identifier: GPL-3.0-or-later
"""Temporary folders, for files that are read once."""

import tempfile

from neuralocks_core.files import cannot_write


def temporary_folder() -> tempfile.TemporaryDirectory:
    """A new folder, which is removed by its `cleanup`, or at the end of its block.

    Raises:
        NeuralocksError: it cannot be made, for example on a full disk.
    """
    try:
        return tempfile.TemporaryDirectory(prefix="neuralocks_", ignore_cleanup_errors=True)
    except OSError as error:
        raise cannot_write(error.filename or "temporary files", error) from None
