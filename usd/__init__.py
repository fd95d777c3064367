# SPDX-License-Identifier: Apache-2.0
"""USD in, USD out: reading shots, writing bakes, and the command line. The only package that imports `pxr`.

from usd.bake import bake
from usd.stage import read_shot
"""
