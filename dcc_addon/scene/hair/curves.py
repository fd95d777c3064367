# SPDX-License-Identifier: GPL-3.0-or-later
"""A hair Curves object: its strands, and where its rest shape is kept while the live view moves the points.

While the hair is live, its rest shape is in the attribute `neuralocks_rest` of the Curves, so it is saved, appended and
undone with the hair. Without the attribute, the points themselves are at rest.
"""

import bpy
import numpy as np

from neuralocks_core import rest_copy
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import transformed

from ...services.rigs.rig import check_strands
from . import unbound
from .nodes import geometry_nodes

REST = rest_copy.NAME
TYPES = ("CATMULL_ROM", "POLY", "BEZIER", "NURBS")
"""Indexed by the number in Blender's attribute `curve_type`."""
KEEPS_CACHES = bpy.app.version < (5, 2) and "add_curves" in bpy.types.Curves.bl_rna.functions
"""Whether Blender keeps the bounds and the smooth curves of the old points until strands are added, even zero: geometry nodes that
resample or mesh the hair would use the old ones.
"""
RADIUS = 0.005
"""Radius of hair without the attribute `radius`, as Cycles draws it, in the object's space."""


def counts(data) -> np.ndarray:
    """Points of each strand, (S,) int32."""
    values = np.empty(len(data.curves), np.int32)
    data.curves.foreach_get("points_length", values)
    return values


def points(data) -> np.ndarray:
    """Points at rest, (P, 3) float32 in the object's space, whether the hair is live or not."""
    return _rest(data) if has_rest(data) else _unmarked(_read(data, "position"))


def shown(data, out: np.ndarray | None = None) -> np.ndarray:
    """Points as they are, (P, 3) float32; in `out`, if that is given and there are positions, as in all but empty curves."""
    return _read(data, "position", out)


def radius(data) -> np.ndarray | None:
    """Of each point (P,) or of each strand (S,), float32 in the object's space, or None."""
    attribute = data.attributes.get("radius")
    sizes = {"POINT": len(data.points), "CURVE": len(data.curves)}
    if attribute is None or sizes.get(attribute.domain) != len(attribute.data):
        return None
    values = np.empty(len(attribute.data), np.float32)
    attribute.data.foreach_get("value", values)
    return values


def one_radius_a_strand(data) -> bool:
    """Whether the attribute `radius` has a value for each strand, as scripts and geometry nodes can leave it since Blender 5.0. Blender
    crashes, or writes beyond the values, where it reads widths of a cache into it.
    """
    attribute = data.attributes.get("radius")
    return attribute is not None and attribute.domain == "CURVE"


def kind(data) -> str:
    """The strands' type, one of TYPES; POLY if they have several types.

    Raises:
        NeuralocksError: some are Bezier curves.
    """
    attribute = data.attributes.get("curve_type")
    if attribute is None or not len(attribute.data):
        return TYPES[0]
    values = np.empty(len(attribute.data), np.int32)
    attribute.data.foreach_get("value", values)
    found = {TYPES[i] for i in np.unique(values)}
    if "BEZIER" in found:
        raise NeuralocksError(
            f"{data.name}: some strands are Bezier curves, whose handles would stay behind; set their type to Catmull Rom "
            "(in Edit Mode, Curves > Set Curve Type)"
        )
    return found.pop() if len(found) == 1 else "POLY"


def check(hair) -> None:
    """Refuse a hair object that cannot be moved, before any long work on it.

    Raises:
        NeuralocksError: it has no strands, or strands that no network can move.
    """
    check_strands(hair.name_full, points(hair.data), counts(hair.data))
    kind(hair.data)


def has_rest(data) -> bool:
    """Whether the rest shape is stored because the points are moved."""
    attribute = data.attributes.get(REST)
    if attribute is None or (attribute.domain, attribute.data_type) != ("POINT", "FLOAT_VECTOR"):
        return False  # also if it was converted by hand
    return len(attribute.data) == len(data.points)


def keep_rest(data, whole: bool = False) -> None:
    """Store the points as rest shape, unless they already are. `whole` says that each point then has one: checking takes a fifth of
    the time of the rest of a live frame.

    Raises:
        NeuralocksError: the data belongs to another file, or to several objects, or cannot be moved by moving its points.
    """
    if data.library is not None or data.override_library is not None:
        moved = (
            "; they are not at rest in that file, because Save did not write it: save that file"
            if has_rest(data)
            else ""
        )
        raise NeuralocksError(
            f"{data.name}: its curves are linked from another file and cannot be moved here; make them local (Object > "
            f"Relations > Make Local > Selected Objects and Data), or use Bake and Attach{moved}"
        )
    if unbound.shared(data):
        raise NeuralocksError(
            f"{data.name}: several objects share these curves, and none can move alone; make them single user (Object > "
            "Relations > Make Single User > Object & Data)"
        )
    if has_rest(data):
        # Joined strands are about to be moved, too.
        if not whole and rest_copy.never_written(_read(data, REST)).any():
            _keep(data, _rest(data))
        return
    kind(data)
    put_aside(data, _read(data, "position"))


def replace_rest(data, values: np.ndarray) -> None:
    """Store (P, 3) float32 as rest shape instead of the one there is; the errors are those of `keep_rest`."""
    keep_rest(data)
    _keep(data, values)


def put_aside(data, values: np.ndarray) -> None:
    """Store (P, 3) float32 as rest shape if none is stored."""
    stale = data.attributes.get(REST)
    if stale is not None:  # the strands were edited since: the old rest shape fits them no longer
        data.attributes.remove(stale)
    data.attributes.new(REST, "FLOAT_VECTOR", "POINT")
    _keep(data, values)


def move_rest(data, matrix: np.ndarray, part: slice = slice(None)) -> None:
    """Move the stored rest shape, or that of some of the points, by a transform (4, 4)."""
    values = _rest(data)
    values[part] = transformed(values[part], matrix)
    _keep(data, values)


def restore_rest(data) -> bool:
    """Put the points back to rest, forget the copy, and let them follow their surface as before; returns whether there was one."""
    unbound.bind(data, "muted")
    if not has_rest(data):
        return False
    write(data, _rest(data))
    data.attributes.remove(data.attributes[REST])
    data.update_tag()
    return True


def write(data, values: np.ndarray) -> None:
    """Move the points to (P, 3) float32. The caller tags the data.

    A flat contiguous float32 array is copied as a block; any other kind goes through Python numbers, ten to a hundred
    times slower.
    """
    data.attributes["position"].data.foreach_set("vector", np.ascontiguousarray(values, np.float32).ravel())
    if KEEPS_CACHES:
        data.add_curves([])


def create(name: str, strands: np.ndarray, points_of: np.ndarray, radii: np.ndarray | None = None, material=None):
    """A new Curves data block of polylines, of this name and material, with `strands` (S,) vertices each, points
    `points_of` (P, 3) and `radii` (P,) float32 in the object's space.
    """
    data = bpy.data.hair_curves.new(name)
    if hasattr(data, "add_curves"):
        data.add_curves([int(n) for n in strands])
        _make_poly(data)
    else:
        data = _by_conversion(name, strands, points_of, data)
    write(data, points_of)
    if radii is not None:
        attribute = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
        attribute.data.foreach_set("value", radii)
    if material is not None:
        data.materials.append(material)
    return data


def _make_poly(data) -> None:
    """Straight segments: Catmull-Rom, the default, is evaluated at twelve times the points by Blender 5.2, without benefit for
    24-point strands.
    """
    if hasattr(data, "set_types"):
        data.set_types(type="POLY")
        return
    # Blender 4.2 keeps count of the types and is not told when the attribute `curve_type` is written: it then writes beyond its
    # arrays. One evaluated point per segment draws the same.
    data.attributes.new("resolution", "INT", "CURVE").data.foreach_set("value", np.ones(len(data.curves), np.int32))


def _by_conversion(name, strands, points_of, empty):
    """Blender before 3.5 cannot add strands from Python: an edge mesh is turned into curves by geometry nodes."""
    bpy.data.hair_curves.remove(empty)
    ends = np.cumsum(strands)
    first = np.arange(len(points_of) - 1)
    edges = np.stack([first, first + 1], axis=1)[~np.isin(first + 1, ends)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(p) for p in points_of.tolist()], [tuple(e) for e in edges.tolist()], [])
    holder = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(holder)
    tree, source, target = geometry_nodes("neuralocks_to_curves")
    convert = tree.nodes.new("GeometryNodeMeshToCurve")
    tree.links.new(source, convert.inputs[0])
    tree.links.new(convert.outputs[0], target)
    holder.modifiers.new("convert", "NODES").node_group = tree
    layer = bpy.context.view_layer
    for other in list(layer.objects.selected):
        other.select_set(False)
    layer.objects.active = holder
    holder.select_set(True)
    bpy.ops.object.convert(target="CURVES")
    data = holder.data
    bpy.data.objects.remove(holder)
    bpy.data.node_groups.remove(tree)
    if not mesh.users:
        bpy.data.meshes.remove(mesh)
    return data


def _read(data, name: str, out: np.ndarray | None = None) -> np.ndarray:
    attribute = data.attributes.get(name)
    if attribute is None or not len(data.points):
        return np.zeros((len(data.points), 3), np.float32)
    values = np.empty((len(data.points), 3), np.float32) if out is None else out
    attribute.data.foreach_get("vector", values.ravel())
    return values


def _rest(data) -> np.ndarray:
    """The stored rest shape. Strands joined to live hair, or to which it was joined, have none yet, that is, zeros: they are at
    rest as they are.
    """
    values = _read(data, REST)
    bare = rest_copy.never_written(values)
    if bare.any():
        values[bare] = _read(data, "position")[bare]
    return _unmarked(values)


def _keep(data, values: np.ndarray) -> None:
    """Write the rest shape. A point at the origin gets a negative zero first, which tells it from one that has no rest yet."""
    values = np.array(values, np.float32)
    values[~values.any(axis=1), 0] = -0.0
    data.attributes[REST].data.foreach_set("vector", values.ravel())


def _unmarked(values: np.ndarray) -> np.ndarray:
    """The same array, with a plain zero again for points at the origin."""
    values[~values.any(axis=1), 0] = 0.0
    return values
