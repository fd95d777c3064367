# SPDX-License-Identifier: GPL-3.0-or-later
"""Which properties animation writes."""


def animated(data, without=()) -> set[str]:
    """Paths that actions, strips and drivers of some animation data write, except NLA tracks of the names `without`; none if there
    is no such data.
    """
    return {path for path, _ in written(data, without)}


def written(data, without=()) -> set[tuple[str, int]]:
    """The same, each path with the numbers of it that are written; 0 if it has only one."""
    return {(curve.data_path, curve.array_index) for curve in _playing(data, without)}


def moved(data) -> set[str]:
    """Those paths that change: written by drivers, or by keys or samples with different values."""
    return {curve.data_path for curve in _playing(data) if not _constant(curve)}


def strips_of(data, without=()) -> list:
    """All NLA strips, also those within others, except those of tracks of the names `without`."""
    strips = [strip for track in data.nla_tracks if track.name not in without for strip in track.strips]
    for strip in strips:  # grows
        strips.extend(getattr(strip, "strips", ()))
    return strips


def curves_of(data, without=()) -> list:
    """F-curves of drivers, actions and strips, muted or not, except those of NLA tracks of the names `without`; none if there is no
    such data.
    """
    if data is None:
        return []
    return [*data.drivers, *(curve for user in (data, *strips_of(data, without)) for curve in _curves(user))]


def curves_in(action, slot: int | None = None) -> list:
    """F-curves of an action; of one of its slots, if a handle is given."""
    if not hasattr(action, "layers"):
        return list(action.fcurves)
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve for bag in bags if slot in (None, bag.slot_handle) for curve in bag.fcurves]


def targets_of(data) -> list[tuple]:
    """What the drivers of some animation data read: each target, after the variable that it belongs to."""
    variables = [variable for curve in data.drivers for variable in curve.driver.variables]
    return [(variable, target) for variable in variables for target in variable.targets]


def is_muted(curve) -> bool:
    """Whether an F-curve does not play."""
    return curve.mute or (curve.group is not None and curve.group.mute)


def _playing(data, without=()) -> list:
    return [curve for curve in curves_of(data, without) if not is_muted(curve)]


def _constant(curve) -> bool:
    points = (*curve.keyframe_points, *curve.sampled_points)  # baked sound is in samples
    return curve.driver is None and not curve.modifiers and len({point.co[1] for point in points}) < 2


def _curves(user) -> list:
    """F-curves that animation data, or a strip, plays of its action: since Blender 4.4 those of one slot."""
    return [] if user.action is None else curves_in(user.action, getattr(user, "action_slot_handle", None))
