# SPDX-License-Identifier: Apache-2.0
"""Commands as a shell gives them, within the process of the test."""

import pytest

from usd.cli.app import main


def status(*words) -> int:
    """Exit status of a command line."""
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    return int(caught.value.code or 0)
