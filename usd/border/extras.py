# SPDX-License-Identifier: Apache-2.0
"""Packages that only some work needs, checked before it begins, not minutes later."""

from importlib import import_module

from neuralocks_core.errors import NeuralocksError


def check_training() -> None:
    """Refuse to train without the packages that learn, write the model, and simulate.

    Raises:
        NeuralocksError: names the package that is missing, or that is there and does not load.
    """
    for name in ("torch", "onnx", "warp"):
        try:
            import_module(name)
        except ModuleNotFoundError as error:
            raise NeuralocksError(f'train: {error.name} is not installed; pip install "neuralocks[train]"') from None
        except (ImportError, OSError) as error:  # such as a library that its compiled part needs; on Windows an OSError
            why = " ".join(str(error).split()) or type(error).__name__
            raise NeuralocksError(f"train: {name} does not load ({why}); reinstall it") from None
