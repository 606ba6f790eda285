"""urdf_of_mjcf: a MuJoCo model as a URDF, by MuJoCo's own compiler (extra ``mjcf``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from syda_gym.embodiments.reading.cleaning import origin_attributes
from syda_gym.errors import EmbodimentError

__all__ = ["urdf_of_mjcf"]


def urdf_of_mjcf(path: Path) -> bytes:
    """Bodies become links, hinges and slides joints, sites fixed links; meshes become the boxes around them.

    MuJoCo obeys what the file says: call it in a process of its own (``converted_apart``).

    Args:
        path: an MJCF, with the meshes that it names.

    Returns:
        The URDF, as bytes of XML.

    Raises:
        EmbodimentError: MuJoCo cannot compile the file.
    """
    import mujoco

    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except Exception as error:  # MuJoCo raises ValueError and its own fatal errors
        raise EmbodimentError(f"{path} is MJCF that MuJoCo cannot compile: {error}") from error
    return _Writer(model, mujoco).text().encode()


class _Writer:
    """One model on its way to URDF."""

    def __init__(self, model: Any, mujoco: Any) -> None:
        self._model, self._mujoco = model, mujoco
        self._out: list[str] = []
        # Where a body's own frame lies in the frame of its link, which stands at the body's last joint.
        self._shift = np.zeros((model.nbody, 3))
        self._bodies = self._names(mujoco.mjtObj.mjOBJ_BODY, model.nbody, "body")
        self._joints = self._names(mujoco.mjtObj.mjOBJ_JOINT, model.njnt, "joint")

    def text(self) -> str:
        self._out = ['<robot name="mjcf">', '<link name="world"/>']
        for body in range(1, self._model.nbody):
            self._write_body(body)
        for site in range(self._model.nsite):
            self._write_site(site)
        return "".join([*self._out, "</robot>"])

    def _names(self, kind: Any, count: int, what: str) -> list[str]:
        return [self._mujoco.mj_id2name(self._model, kind, i) or f"{what}_{i}" for i in range(count)]

    def _write_body(self, body: int) -> None:
        model = self._model
        parent_body = int(model.body_parentid[body])
        parent, place = self._bodies[parent_body], self._shift[parent_body] + model.body_pos[body]
        rotation = _matrix(model.body_quat[body])
        first = int(model.body_jntadr[body])
        turning = [
            joint
            for joint in range(first, first + int(model.body_jntnum[body]))
            if int(model.jnt_type[joint])
            in (int(self._mujoco.mjtJoint.mjJNT_HINGE), int(self._mujoco.mjtJoint.mjJNT_SLIDE))
        ]
        name, at = self._bodies[body], np.zeros(3)
        if not turning:  # welded, floating, or a ball that nothing drives: it stands where it is
            self._joint(f"{name}_weld", "fixed", parent, name, place, _rpy(rotation), "")
        for index, joint in enumerate(turning):
            anchor = model.jnt_pos[joint]
            child = name if joint == turning[-1] else f"{name}_{index}"
            origin = place + rotation @ anchor if index == 0 else anchor - at
            turn = _rpy(rotation) if index == 0 else "0 0 0"
            kind, body_text = self._limits(joint)
            self._joint(self._joints[joint], kind, parent, child, origin, turn, body_text)
            if child != name:
                self._out.append(f"<link name={quoteattr(child)}/>")
            parent, at = child, anchor
        self._shift[body] = -at
        self._write_link(body, name)

    def _limits(self, joint: int) -> tuple[str, str]:
        model = self._model
        slide = int(model.jnt_type[joint]) == int(self._mujoco.mjtJoint.mjJNT_SLIDE)
        axis = f'<axis xyz="{_triple(model.jnt_axis[joint])}"/>'
        force = self._effort(joint)
        effort = f' effort="{force:.9g}"' if force else ""
        rest = float(model.qpos0[model.jnt_qposadr[joint]])
        mimic = self._mimic(joint)
        if model.jnt_limited[joint]:
            low, high = (float(v) - rest for v in model.jnt_range[joint])
            return (
                "prismatic" if slide else "revolute",
                f'{axis}<limit lower="{low:.9g}" upper="{high:.9g}"{effort}/>{mimic}',
            )
        return ("prismatic" if slide else "continuous"), f"{axis}<limit{effort}/>{mimic}"

    def _effort(self, joint: int) -> float:
        """Largest force of the actuators on a joint [N m], 0 if unknown."""
        model, found = self._model, 0.0
        for actuator in range(model.nu):
            on_joint = int(model.actuator_trntype[actuator]) == int(self._mujoco.mjtTrn.mjTRN_JOINT)
            if not on_joint or int(model.actuator_trnid[actuator, 0]) != joint:
                continue
            gear = abs(float(model.actuator_gear[actuator, 0]))
            if model.actuator_forcelimited[actuator]:
                found = max(found, gear * float(np.abs(model.actuator_forcerange[actuator]).max()))
        if not found and model.jnt_actfrclimited[joint]:
            found = float(np.abs(model.jnt_actfrcrange[joint]).max())
        return found

    def _mimic(self, joint: int) -> str:
        model = self._model
        for row in range(model.neq):
            kind = int(self._mujoco.mjtEq.mjEQ_JOINT)
            coupled = int(model.eq_type[row]) == kind and int(model.eq_obj1id[row]) == joint
            if coupled and int(model.eq_obj2id[row]) >= 0:
                leader = quoteattr(self._joints[int(model.eq_obj2id[row])])
                offset, slope = (float(v) for v in model.eq_data[row, :2])
                return f'<mimic joint={leader} multiplier="{slope:.9g}" offset="{offset:.9g}"/>'
        return ""

    def _joint(self, name: str, kind: str, parent: str, child: str, at: Any, rpy: str, inside: str) -> None:
        self._out.append(
            f'<joint name={quoteattr(name)} type="{kind}"><origin xyz="{_triple(at)}" rpy="{rpy}"/>'
            f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/>{inside}</joint>"
        )

    def _write_link(self, body: int, name: str) -> None:
        model, shift = self._model, self._shift[body]
        self._out.append(f"<link name={quoteattr(name)}>")
        if model.body_mass[body] > 0.0:
            x, y, z = model.body_inertia[body]
            self._out.append(
                f'<inertial><origin xyz="{_triple(shift + model.body_ipos[body])}" '
                f'rpy="{_rpy(_matrix(model.body_iquat[body]))}"/><mass value="{float(model.body_mass[body]):.9g}"/>'
                f'<inertia ixx="{x:.9g}" iyy="{y:.9g}" izz="{z:.9g}" ixy="0" ixz="0" iyz="0"/></inertial>'
            )
        first = int(model.body_geomadr[body])
        for geom in range(first, first + int(model.body_geomnum[body])):
            self._write_geom(geom, shift)
        self._out.append("</link>")

    def _write_geom(self, geom: int, shift: Any) -> None:
        model, kinds = self._model, self._mujoco.mjtGeom
        kind, size = int(model.geom_type[geom]), model.geom_size[geom]
        centre, rotation = shift + model.geom_pos[geom], _matrix(model.geom_quat[geom])
        if kind == int(kinds.mjGEOM_SPHERE):
            shapes = [(f'<sphere radius="{size[0]:.6g}"/>', np.zeros(3))]
        elif kind in (int(kinds.mjGEOM_CYLINDER), int(kinds.mjGEOM_CAPSULE)):
            shapes = [(f'<cylinder radius="{size[0]:.6g}" length="{2.0 * size[1]:.6g}"/>', np.zeros(3))]
            if kind == int(kinds.mjGEOM_CAPSULE):  # URDF writes a capsule as a cylinder between two spheres
                ball = f'<sphere radius="{size[0]:.6g}"/>'
                shapes += [(ball, np.array([0.0, 0.0, sign * size[1]])) for sign in (1.0, -1.0)]
        elif kind in (int(kinds.mjGEOM_BOX), int(kinds.mjGEOM_ELLIPSOID)):
            shapes = [(f'<box size="{_triple(2.0 * size)}"/>', np.zeros(3))]
        elif kind == int(kinds.mjGEOM_MESH):
            middle, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            shapes = [(f'<box size="{_triple(2.0 * half)}"/>', middle)]
        else:
            return  # planes and height fields belong to the world
        touches = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
        for text, offset in shapes:
            origin = f'<origin xyz="{_triple(centre + rotation @ offset)}" rpy="{_rpy(rotation)}"/>'
            for role in ("visual", "collision") if touches else ("visual",):
                self._out.append(f"<{role}>{origin}<geometry>{text}</geometry></{role}>")

    def _write_site(self, site: int) -> None:
        name = self._mujoco.mj_id2name(self._model, self._mujoco.mjtObj.mjOBJ_SITE, site)
        if not name or name in self._bodies:
            return
        body = int(self._model.site_bodyid[site])
        self._out.append(f"<link name={quoteattr(name)}/>")
        at, rpy = self._shift[body] + self._model.site_pos[site], _rpy(_matrix(self._model.site_quat[site]))
        self._joint(f"{name}_site", "fixed", self._bodies[body], name, at, rpy, "")


def _matrix(quaternion: Any) -> Any:
    """Rotation matrix of MuJoCo's quaternion (w, x, y, z)."""
    from scipy.spatial.transform import Rotation

    w, x, y, z = (float(v) for v in quaternion)
    return Rotation.from_quat([x, y, z, w]).as_matrix()


def _rpy(rotation: Any) -> str:
    place = np.eye(4)
    place[:3, :3] = rotation
    return origin_attributes(place)["rpy"]


def _triple(values: Any) -> str:
    return " ".join(f"{float(v):.12g}" for v in values)
