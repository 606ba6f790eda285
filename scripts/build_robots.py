"""Write the bundled robots (URDF and description) from tables of published numbers.

Run it from anywhere: ``python scripts/build_robots.py [TABLES] [--out FOLDER]``. ``TABLES`` is the folder of
``pepper_kinematics.json`` and ``nao_kinematics.json``. The output depends on these files only, byte for byte.
"""

from __future__ import annotations

import argparse
import json
import math
import textwrap
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from robot_shapes import COLORS, ZERO, Shape, Vector, add, from_table, nao_looks, pepper_looks

REPOSITORY = Path(__file__).resolve().parents[1]
# A link without <inertial> weighs 1 kg in PyBullet: empty frames get a weight that changes nothing.
FRAME_MASS, FRAME_INERTIA = 1e-3, 1e-6
# A held robot whose feet touch the floor has contacts that nobody wants: they cost time and blur determinism.
SOLE_CLEARANCE = 0.003
WHEELS = ("WheelFL_link", "WheelFR_link", "WheelB_link")


@dataclass(frozen=True)
class Joint:
    """A URDF joint; ``limits`` is (lower, upper, velocity, effort), absent for a fixed joint."""

    name: str
    parent: str
    child: str
    xyz: Vector
    rpy: Vector = ZERO
    axis: Vector = ZERO
    limits: tuple[float, float, float, float] | None = None


@dataclass(frozen=True)
class Inertial:
    """Mass, centre of mass in the link frame, and inertia matrix about it."""

    mass: float = FRAME_MASS
    com: Vector = ZERO
    inertia: np.ndarray = field(default_factory=lambda: FRAME_INERTIA * np.eye(3))


@dataclass
class Model:
    """All that a URDF says."""

    name: str
    notes: list[str]
    root: str
    joints: list[Joint]
    inertials: dict[str, Inertial]
    visuals: dict[str, list[Shape]]
    collisions: dict[str, list[Shape]]


def table_inertial(link: Mapping[str, Any], shift: Sequence[float] = ZERO) -> Inertial:
    """The inertial of one link of the tables, its frame ``shift`` below where the tables have it."""
    i = link["inertia_about_com"]
    matrix = [[i["ixx"], i["ixy"], i["ixz"]], [i["ixy"], i["iyy"], i["iyz"]], [i["ixz"], i["iyz"], i["izz"]]]
    return Inertial(link["mass"], add(link["com"], shift), np.asarray(matrix))


def welded(parts: Sequence[Inertial]) -> Inertial:
    """Bodies with parallel axes welded into one."""
    mass = sum(part.mass for part in parts)
    com = np.sum([part.mass * np.asarray(part.com) for part in parts], axis=0) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        d = np.asarray(part.com) - com
        inertia += part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Inertial(mass, add(com, ZERO), inertia)


def turned(inertial: Inertial, yaw: float, at: Vector) -> Inertial:
    """A body whose frame stands at ``at``, turned by ``yaw``, seen from the frame it stands in."""
    c, s = math.cos(yaw), math.sin(yaw)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    com = rotation @ np.asarray(inertial.com) + np.asarray(at)
    return Inertial(inertial.mass, add(com, ZERO), rotation @ inertial.inertia @ rotation.T)


def table_joint(row: Mapping[str, Any], limits: Mapping[str, Any] | None = None) -> Joint:
    """One joint of the tables; ``limits`` is the row with the limits where it is another one."""
    limits = limits or row
    bounds = None
    if row["type"] != "fixed":
        bounds = (limits["lower"], limits["upper"], limits["velocity"], limits["effort"])
    axis = add(row.get("axis", ZERO), ZERO)
    placed = add(row["origin_xyz"], ZERO), add(row["origin_rpy"], ZERO)
    return Joint(row["name"], row["parent"], row["child"], *placed, axis, bounds)


def table_collisions(tables: Mapping[str, Any]) -> dict[str, list[Shape]]:
    """The shapes that collide: those of the tables that are no decoration."""
    links = tables["collision_geometry"]["links"]
    return {
        link: [shape for row in rows if not row.get("visual_only") for shape in from_table(row)]
        for link, rows in links.items()
    }


def links_of(joints: Sequence[Joint], root: str) -> Iterator[str]:
    """Every link, the root first."""
    yield root
    yield from (joint.child for joint in joints)


def pepper_model(tables: Mapping[str, Any]) -> Model:
    """Pepper rooted at its base on the floor; wheels welded to the base, fingers to the wrists."""
    rooted = tables["base_rooted_tree"]
    by_name = {row["name"]: row for row in tables["joints"]}
    legs = [table_joint(row, by_name.get(row["name"])) for row in rooted["joints"]]
    moved = {joint.name for joint in legs}
    joints = legs + [table_joint(row) for row in tables["joints"] if row["name"] not in moved]

    shifts = {link: add(shift, ZERO) for link, shift in rooted["frame_shift_of_links"].items()}
    inertials = {link: table_inertial(row, shifts.get(link, ZERO)) for link, row in tables["links"].items()}
    wheels = []
    for wheel in WHEELS:
        frame = tables["sensor_frames"][wheel]
        wheels.append(turned(inertials.pop(wheel), frame["rpy"][2], add(frame["xyz"], ZERO)))
    inertials["Tibia"] = welded([inertials["Tibia"], *wheels])

    collisions = table_collisions(tables)
    # The core of the hip lies inside waist and pelvis: it would only ever collide with its neighbours.
    collisions.pop("Hip")
    # The wheels touch the floor. PyBullet lets a fixed root stand on it without contacts, which cost time and
    # make a run depend on the one before it; a link welded to the root would have them.
    root, to_tibia = legs[0].parent, legs[0].xyz
    collisions[root] = []
    for wheel in WHEELS:
        at = add(tables["sensor_frames"][wheel]["xyz"], to_tibia)
        collisions[root] += [shape.moved(at) for shape in collisions.pop(wheel)]
    notes = [
        "The base stands on the floor (z = 0 of base_footprint). Joint angles are the vendor's.",
        "'torso' is the vendor's torso frame. The frames of Pelvis and Hip lie at their lower joints.",
        "Wheels weigh on Tibia and collide with base_footprint. LHand and RHand move empty grippers; the "
        "fingers you see are welded half open to the wrists.",
    ]
    return Model(
        "pepper",
        notes,
        root,
        joints,
        {link: inertials.get(link, Inertial()) for link in links_of(joints, root)},
        {link: [s.moved(shifts.get(link, ZERO)) for s in shapes] for link, shapes in pepper_looks().items()},
        {link: [s.moved(shifts.get(link, ZERO)) for s in shapes] for link, shapes in collisions.items()},
    )


def nao_model(tables: Mapping[str, Any]) -> Model:
    """NAO held by the torso, the soles of straight legs just over the floor."""
    height = tables["overall_dimensions"]["torso_to_sole_zero"] + SOLE_CLEARANCE
    joints = [Joint("torso_fixed", "base_footprint", "torso", (0.0, 0.0, height))]
    joints += [table_joint(row) for row in tables["joints"] + tables["fixed_joints"]]
    # The grippers of the tables weigh 2 mg, too little for a physics engine to divide by.
    heavy = {link: row for link, row in tables["links"].items() if row["mass"] > FRAME_MASS}
    notes = [
        "The torso is held above base_footprint (the floor, z = 0), 3 mm higher than straight legs stand.",
        "LHipYawPitch and RHipYawPitch are one motor in the robot: command them equally.",
        "Fingers are welded half open to the wrists; LHand and RHand move empty grippers.",
        "Shapes are estimates from the link lengths.",
    ]
    return Model(
        "nao",
        notes,
        "base_footprint",
        joints,
        {
            link: table_inertial(heavy[link]) if link in heavy else Inertial()
            for link in links_of(joints, "base_footprint")
        },
        nao_looks(),
        table_collisions(tables),
    )


def number(value: float) -> str:
    """A number as short as it can be without losing what the tables say."""
    text = f"{round(float(value), 12):.9g}"
    return "0" if text == "-0" else text


def _numbers(values: Iterable[float]) -> str:
    return " ".join(number(value) for value in values)


def _origin(parent: ET.Element, xyz: Vector, rpy: Vector = ZERO) -> None:
    ET.SubElement(parent, "origin", xyz=_numbers(xyz), rpy=_numbers(rpy))


def _shape_element(link: ET.Element, tag: str, shape: Shape) -> None:
    element = ET.SubElement(link, tag)
    _origin(element, shape.xyz, shape.rpy)
    names = {"sphere": ("radius",), "cylinder": ("radius", "length")}.get(shape.kind)
    values = [number(value) for value in shape.size]
    attributes = dict(zip(names, values, strict=True)) if names else {"size": " ".join(values)}
    ET.SubElement(ET.SubElement(element, "geometry"), shape.kind, attributes)
    if tag == "visual":
        ET.SubElement(element, "material", name=shape.color)


def _link_element(robot: ET.Element, name: str, model: Model) -> None:
    link = ET.SubElement(robot, "link", name=name)
    body = model.inertials[name]
    inertial = ET.SubElement(link, "inertial")
    _origin(inertial, body.com)
    ET.SubElement(inertial, "mass", value=number(body.mass))
    entries = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ET.SubElement(inertial, "inertia", {key: number(body.inertia[at]) for key, at in entries.items()})
    for tag, shapes in (("visual", model.visuals), ("collision", model.collisions)):
        for shape in shapes.get(name, []):
            _shape_element(link, tag, shape)


def _joint_element(robot: ET.Element, joint: Joint) -> None:
    kind = "fixed" if joint.limits is None else "revolute"
    element = ET.SubElement(robot, "joint", name=joint.name, type=kind)
    _origin(element, joint.xyz, joint.rpy)
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    if joint.limits is not None:
        ET.SubElement(element, "axis", xyz=_numbers(joint.axis))
        names = ("lower", "upper", "velocity", "effort")
        values = map(number, joint.limits)
        ET.SubElement(element, "limit", dict(zip(names, values, strict=True)))


def header(model: Model, sources: Mapping[str, str]) -> str:
    """The comment at the head of a URDF: where it comes from and what is particular about it."""
    # Two hyphens end an XML comment; the flags that a source speaks of stay in the tables.
    lines = [f"{key}: {text}".replace("--", "-").replace(" (flags below)", "") for key, text in sources.items()]
    paragraphs = ["Generated by scripts/build_robots.py: change that, not this.", *model.notes, "Sources:"]
    wrapped = [textwrap.fill(text, 110, initial_indent="  ") for text in paragraphs]
    wrapped += [textwrap.fill(line, 110, initial_indent="    ", subsequent_indent="      ") for line in lines]
    return "<!--\n" + "\n".join(wrapped) + "\n-->\n"


def urdf_text(model: Model, sources: Mapping[str, str]) -> str:
    """The whole URDF."""
    robot = ET.Element("robot", name=model.name)
    used = {shape.color for shapes in model.visuals.values() for shape in shapes}
    for color in (color for color in COLORS if color in used):
        material = ET.SubElement(robot, "material", name=color)
        ET.SubElement(material, "color", rgba=_numbers(COLORS[color]))
    for link in links_of(model.joints, model.root):
        _link_element(robot, link, model)
    for joint in model.joints:
        _joint_element(robot, joint)
    ET.indent(robot)
    body = ET.tostring(robot, encoding="unicode")
    return '<?xml version="1.0"?>\n' + header(model, sources) + body + "\n"


def coupled_limit(table: Mapping[str, Any], joint: Joint, by: Joint) -> dict[str, Any]:
    """A table of limits in radians, kept inside the plain limits of both joints."""
    if joint.limits is None or by.limits is None:
        raise ValueError(f"{joint.name} and {by.name} must both move to limit each other.")

    def column(name: str, limits: tuple[float, float, float, float]) -> list[float]:
        values = table.get(f"{name}_rad") or [math.radians(value) for value in table[f"{name}_deg"]]
        return [min(max(round(value, 6), limits[0]), limits[1]) for value in values]

    return {
        "joint": joint.name,
        "by": by.name,
        "at": column(by.name, by.limits),
        "lower": column(f"{joint.name}_min", joint.limits),
        "upper": column(f"{joint.name}_max", joint.limits),
    }


def arm(side: str) -> dict[str, Any]:
    """One arm; both robots name their arms alike."""
    upper, lower = side[0].upper(), side[0]
    joints = [f"{upper}{name}" for name in ("ShoulderPitch", "ShoulderRoll", "ElbowYaw", "ElbowRoll", "WristYaw")]
    wrist = f"{lower}_wrist"
    ends = {"shoulder": f"{upper}Bicep", "elbow": f"{upper}Elbow", "wrist": wrist, "tip": wrist}
    return {"side": side, "joints": joints, **ends}


def description(model: Model, tables: Mapping[str, Any], rest: Mapping[str, float], pairs: list[list[str]]) -> str:
    """The YAML that says what a URDF cannot."""
    by_name = {joint.name: joint for joint in model.joints}
    coupled = [
        coupled_limit(table, *(by_name[name] for name in key.split("_vs_")))
        for key, table in tables["coupled_limits"].items()
        if "_vs_" in key
    ]
    ordered = {joint.name: float(rest[joint.name]) for joint in model.joints if joint.name in rest}
    sections: list[tuple[str, str, Any]] = [
        ("Generated by scripts/build_robots.py. Lengths in metres, angles in radians.", "name", model.name),
        ("Relative to this file.", "urdf", f"{model.name}.urdf"),
        ("The link in whose frame (x forward, y left, z up) landmarks are expressed.", "torso", "torso"),
        ("", "height", tables["overall_dimensions"]["height"]),
        (
            "Links whose origins are shoulder, elbow, wrist and the end of the arm.",
            "arms",
            [arm("left"), arm("right")],
        ),
        ("Limits of a joint that depend on another one, linear between rows.", "coupled_limits", coupled),
        ("The pose to start from and to return to.", "rest", ordered),
        ("Pairs of links, beside parents and children, that never collide.", "disabled_collisions", pairs),
    ]
    return "".join((f"# {comment}\n" if comment else "") + yaml_entry(key, value) for comment, key, value in sections)


def yaml_entry(key: str, value: Any) -> str:
    """One top-level entry, lists of plain values on one line."""
    if isinstance(value, (str, float)):
        return f"{key}: {value}\n"
    return yaml.safe_dump({key: value}, sort_keys=False, default_flow_style=None, width=108)


def pepper_description(model: Model, tables: Mapping[str, Any]) -> str:
    """Pepper's description; it rests as the vendor's StandInit."""
    listed = tables["collision_geometry"]["disabled_pairs"]["extra"]
    pairs = [pair for pair in listed if pair[1] not in WHEELS]
    return description(model, tables, tables["poses"]["StandInit_nominal"]["joints"], pairs)


def nao_description(model: Model, tables: Mapping[str, Any]) -> str:
    """NAO's description; it rests as in StandInit, but on straight legs: so high is its torso held."""
    pose = tables["poses"]["StandInit"]["joints"]
    legs = ("Hip", "Knee", "Ankle")
    rest = {joint: 0.0 if joint[1:].startswith(legs) else angle for joint, angle in pose.items()}
    pairs = [["torso", "Head"]]
    for side, wrist, ankle in (("L", "l_wrist", "l_ankle"), ("R", "r_wrist", "r_ankle")):
        shoulder, bicep, elbow, forearm = (side + part for part in ("Shoulder", "Bicep", "Elbow", "ForeArm"))
        pairs += [["torso", bicep], [shoulder, elbow], [bicep, forearm], [elbow, wrist]]
        pairs += [["torso", f"{side}Thigh"], [f"{side}Tibia", ankle]]
    return description(model, tables, rest, pairs)


Build = tuple[Callable[[Mapping[str, Any]], Model], Callable[[Model, Mapping[str, Any]], str]]
ROBOTS: dict[str, Build] = {"pepper": (pepper_model, pepper_description), "nao": (nao_model, nao_description)}


def build(tables_folder: Path, out: Path) -> None:
    """Writes URDF and description of every robot into ``out``."""
    for name, (make_model, describe) in ROBOTS.items():
        tables = json.loads((tables_folder / f"{name}_kinematics.json").read_text(encoding="utf-8"))
        model = make_model(tables)
        urdf = urdf_text(model, tables["meta"]["sources"])
        (out / f"{name}.urdf").write_text(urdf, encoding="utf-8", newline="\n")
        (out / f"{name}.yaml").write_text(describe(model, tables), encoding="utf-8", newline="\n")


def main() -> None:
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("tables", type=Path, nargs="?", default=REPOSITORY.parent / "shared" / "robots")
    parser.add_argument("--out", type=Path, default=REPOSITORY / "syda_gym" / "assets" / "robots")
    arguments = parser.parse_args()
    build(arguments.tables, arguments.out)


if __name__ == "__main__":
    main()
