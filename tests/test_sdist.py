# SPDX-License-Identifier: Apache-2.0
"""What is in the source archive that is handed on."""

import re
import tarfile
from pathlib import Path

import pytest

pytest.importorskip("hatchling", reason="builds the archive")

from hatchling.builders.sdist import SdistBuilder

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Name in the archive -> content."""
    made = next(SdistBuilder(str(ROOT)).build(directory=str(tmp_path_factory.mktemp("sdist"))))
    with tarfile.open(made) as packed:
        return {each.name.split("/", 1)[1]: packed.extractfile(each).read() for each in packed if each.isfile()}


def test_it_holds_what_its_readme_installs_with_and_bakes(archive):
    """`make demo`, pip's constraints, and the examples that need no Blender and no other program's file."""
    readme = archive["README.md"].decode()
    constraints = re.findall(r"install -c (\S+)", readme)
    shots = re.findall(r"examples/[\w/]+\.usda", readme + archive["docs/architecture.md"].decode())
    assert constraints and {*constraints, *shots, "Makefile", "examples/strand_runtime.py"} <= archive.keys()


def test_it_is_under_the_licence_that_it_states(archive):
    assert b'license = "Apache-2.0"' in archive["pyproject.toml"]
    assert not [name for name, content in archive.items() if name.endswith(".py") and b"GPL-3.0" in content[:100]]
