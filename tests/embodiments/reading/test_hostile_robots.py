"""MJCF and xacro of strangers: their libraries obey what a file says, and take nobody along."""

from __future__ import annotations

import os
import sys
import time
import zipfile
from pathlib import Path

import pytest

from syda_gym.embodiments.kinematics.urdf import read_urdf
from syda_gym.embodiments.reading import apart, shapes
from syda_gym.errors import EmbodimentError

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
MJCF = {
    "a field of 40 GB": '<asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset>',
    "an arena of 100 GB": '<size memory="100G"/>',
    "a texture of 120 GB": '<asset><texture name="t" type="2d" builtin="flat" width="200000" height="200000"/></asset>',
    "itself": '<include file="robot.xml"/>',
    "a file elsewhere": '<include file="/etc/passwd"/>',
    "a mesh without end": '<asset><mesh name="m" file="/dev/zero"/></asset>'
    '<worldbody><geom type="mesh" mesh="m"/></worldbody>',
}
XACROS = {
    "a string of 100 GB": "<link name=\"${'a' * 10**11}\"/>",
    "a macro that calls itself": '<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>',
    "every class": '<link name="${().__class__.__base__.__subclasses__()}"/>',
    "a program": "<link name=\"${__import__('os').system('touch ran')}\"/>",
    "a file": "<link name=\"${open('/etc/passwd').read()}\"/>",
    "an object of YAML": "<link name=\"${xacro.load_yaml('evil.yaml')}\"/>",
    "a file elsewhere": '<xacro:include filename="/etc/passwd"/>',
}


@pytest.mark.parametrize("what", MJCF)
def test_a_model_that_asks_for_too_much_is_refused(tmp_path: Path, what: str) -> None:
    pytest.importorskip("mujoco")
    path = tmp_path / "robot.xml"
    path.write_text(f"<mujoco>{MJCF[what]}</mujoco>")
    with pytest.raises(EmbodimentError, match=r"MJCF that MuJoCo cannot compile|asks for too much"):
        read_urdf(path)


@pytest.mark.parametrize("what", XACROS)
def test_a_xacro_that_asks_for_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str) -> None:
    pytest.importorskip("xacrodoc")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "evil.yaml").write_text('!!python/object/apply:os.system ["touch ran"]\n')
    path = tmp_path / "robot.xacro"
    path.write_text(f'<robot name="a" {XACRO}>{XACROS[what]}</robot>')
    with pytest.raises(EmbodimentError, match=r"xacro that does not expand|asks for too much") as caught:
        read_urdf(path)
    assert "root:" not in str(caught.value), "nothing of a file elsewhere is told"
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("entity", ['<!ENTITY a "x">', '<!ENTITY a SYSTEM "file:///etc/passwd">'])
@pytest.mark.parametrize("ending", [".urdf", ".xacro", ".xml"])
def test_entities_are_refused_before_anything_is_opened(tmp_path: Path, entity: str, ending: str) -> None:
    path = tmp_path / f"robot{ending}"
    inside = '<xacro:macro name="m"/>' if ending == ".xacro" else ""
    path.write_text(f'<!DOCTYPE r [{entity}]><robot name="a" {XACRO}>{inside}<link name="b">&a;</link></robot>')
    with pytest.raises(EmbodimentError, match="entities"):
        read_urdf(path)


def test_a_conversion_without_end_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("xacrodoc")
    monkeypatch.setattr(apart, "_SECONDS", 3.0)
    path = tmp_path / "robot.xacro"
    path.write_text(f'<robot name="a" {XACRO}><link name="${{10**10**9}}"/></robot>')
    begun = time.monotonic()
    with pytest.raises(EmbodimentError, match=r"takes too long|asks for too much"):
        read_urdf(path)
    assert time.monotonic() - begun < 60.0


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pipes of this kind")
def test_pipes_and_devices_are_no_robots_and_no_meshes(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "robot.urdf")
    for path in (tmp_path / "robot.urdf", Path("/dev/zero"), tmp_path):
        with pytest.raises(EmbodimentError, match="no URDF"):
            read_urdf(path)
    os.mkfifo(tmp_path / "pipe.stl")
    (tmp_path / "zero.stl").symlink_to("/dev/zero")
    links = "".join(
        f'<link name="{name}"><collision><geometry><mesh filename="{mesh}"/></geometry></collision></link>'
        for name, mesh in (("a", "pipe.stl"), ("b", "zero.stl"), ("c", "/dev/zero"), ("d", "package://x/../../y.stl"))
    )
    joints = "".join(
        f'<joint name="{child}" type="fixed"><parent link="a"/><child link="{child}"/></joint>' for child in "bcd"
    )
    path = tmp_path / "meshes.urdf"
    path.write_text(f'<robot name="r">{links}{joints}</robot>')
    assert read_urdf(path) is not None


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such devices")
def test_what_a_mesh_names_is_not_opened(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    mesh = tmp_path / "a.obj"
    mesh.write_text(f"mtllib /dev/zero\n{corners}usemtl m\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n")
    assert len(shapes._mesh_corners(mesh)) == 4
    archive = tmp_path / "a.zip"
    with zipfile.ZipFile(archive, "w") as file:
        file.write(mesh, "a.obj")
    assert len(shapes._mesh_corners(archive)) == 0
