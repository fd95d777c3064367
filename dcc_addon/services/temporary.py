# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders among the temporary files, for what is written to be read once."""

import tempfile

from neuralocks_core.files import cannot_write


def temporary_folder() -> tempfile.TemporaryDirectory:
    """A new folder, which goes with its `cleanup`, or with its block.

    Raises:
        NeuralocksError: there can be none, as on a full disk.
    """
    try:
        return tempfile.TemporaryDirectory(prefix="neuralocks_", ignore_cleanup_errors=True)
    except OSError as error:
        raise cannot_write(error.filename or "temporary files", error) from None
