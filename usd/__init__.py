# SPDX-License-Identifier: Apache-2.0
"""USD in, USD out: reading shots, writing bakes, and the command line. The only package that imports `pxr`.

Begin with `usd.baking.bake.bake` or `usd.shot.stage.read_shot`.
"""
