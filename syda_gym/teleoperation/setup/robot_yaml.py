"""robot_yaml: a description as the YAML that people read and edit."""

from __future__ import annotations

import yaml

from syda_gym.embodiments.description import POINTS, ArmDescription, RobotDescription

__all__ = ["robot_yaml"]


def robot_yaml(description: RobotDescription) -> str:
    """The text, with a comment above each part."""
    parts: list[tuple[str, dict[str, object]]] = [
        (
            "# Found by `syda-gym robot add`; edit what is wrong, then look again: syda-gym robot show "
            f"{description.name}\n# Lengths in metres, angles in radians.",
            {"name": description.name, "urdf": str(description.urdf)},
        ),
        (
            "# The link in whose frame landmarks are expressed (x forward, y left, z up after `axes`).",
            {"torso": description.torso, "height": round(description.height, 3)},
        ),
    ]
    if description.axes is not None:
        rows = [list(row) for row in description.axes]
        parts.append(("# Rows: forward, left and up of the body, in the torso link's own frame.", {"axes": rows}))
    arms = [_arm(arm) for arm in description.arms]
    parts.append(
        (
            "# Links that carry shoulder, elbow, wrist and the end of the arm; a point off its link's origin is\n"
            "# written {link: NAME, offset: [x, y, z]}, in the link's frame.",
            {"arms": arms},
        )
    )
    parts.append(("# The pose to start from and to return to.", {"rest": dict(description.rest)}))
    if description.coupled_limits:
        rows_of_limits = [
            {"joint": c.joint, "by": c.by, "at": list(c.at), "lower": list(c.lower), "upper": list(c.upper)}
            for c in description.coupled_limits
        ]
        parts.append(("# Limits of a joint that depend on another one.", {"coupled_limits": rows_of_limits}))
    if description.disabled_collisions:
        pairs = [list(pair) for pair in description.disabled_collisions]
        parts.append(
            (
                "# Pairs of links whose contact is ignored: they overlap by construction or at rest.",
                {"disabled_collisions": pairs},
            )
        )
    return "".join(f"{comment}\n{_dumped(value)}" for comment, value in parts)


def _arm(arm: ArmDescription) -> dict[str, object]:
    points: dict[str, object] = {}
    for point, link in zip(POINTS, arm.links, strict=True):
        offset = arm.offsets.get(point)
        points[point] = link if offset is None else {"link": link, "offset": list(offset)}
    return {"side": arm.side, "joints": list(arm.joints), **points}


def _dumped(value: dict[str, object]) -> str:
    """One key a line, small lists and tables within the line."""
    return "".join(
        yaml.safe_dump(
            {key: one}, sort_keys=False, width=110, default_flow_style=None if isinstance(one, list | dict) else False
        )
        for key, one in value.items()
    )
