# SPDX-License-Identifier: Apache-2.0
"""Shots of mesh hair that tests change."""

import pytest
from pxr import Usd

from ..rig_shots import small_shot


@pytest.fixture
def edited(tmp_path):
    """Makes a small shot whose stage a function has changed."""

    def make(change, **options):
        path = small_shot(tmp_path / "shot.usda", **options)
        stage = Usd.Stage.Open(str(path))
        change(stage)
        stage.GetRootLayer().Save()
        return path

    return make
