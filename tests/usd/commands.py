# SPDX-License-Identifier: Apache-2.0
"""Commands as a shell gives them, within the process of the test, and what they say."""

import pytest

from usd.cli.app import main
from usd.review.inspect import inspect


def status(*words) -> int:
    """Exit status of a command line."""
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    return int(caught.value.code or 0)


def spoils(path, **options) -> list[str]:
    """What `inspect` says would spoil a bake, except of the models that would move its hair."""
    return [
        note for note in inspect(path, **options)["spoils"] if ": the model was trained on another body" not in note
    ]
