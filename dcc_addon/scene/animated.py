# SPDX-License-Identifier: GPL-3.0-or-later
"""Which properties animation writes."""


def animated(data, without=()) -> set[str]:
    """Paths that actions, strips and drivers of some animation data write, but for NLA tracks of the names `without`; none
    where there is no such data.
    """
    if data is None:
        return set()
    actions = {data.action, *(strip.action for strip in strips_of(data, without))} - {None}
    return {curve.data_path for curve in [*data.drivers, *(c for action in actions for c in _curves(action))]}


def strips_of(data, without=()) -> list:
    """All NLA strips, those within others too, but for those of tracks of the names `without`."""
    strips = [strip for track in data.nla_tracks if track.name not in without for strip in track.strips]
    for strip in strips:  # grows
        strips.extend(getattr(strip, "strips", ()))
    return strips


def _curves(action) -> list:
    """F-curves of all slots; where actions have slots, `fcurves` are those of the first one, or gone."""
    if len(getattr(action, "layers", ())):
        return [
            c for layer in action.layers for strip in layer.strips for bag in strip.channelbags for c in bag.fcurves
        ]
    return list(getattr(action, "fcurves", ()))
