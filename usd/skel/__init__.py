# SPDX-License-Identifier: Apache-2.0
"""UsdSkel characters as arrays: skeleton, skin, blend shapes, joint samples."""
