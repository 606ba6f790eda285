"""YAML and URDF that are built to hurt: the part of ``fuzz_build`` for descriptions of robots."""

from __future__ import annotations

import numpy as np

__all__ = [
    "alias_in_itself",
    "aliases",
    "deep_yaml",
    "large_yaml",
    "merge_keys",
    "urdf_chain",
    "urdf_circle",
    "urdf_odd",
    "urdf_star",
]


def _some(rng: np.random.Generator, *values: int) -> int:
    return int(rng.choice(values))


# YAML


def aliases(_: list[bytes], rng: np.random.Generator) -> bytes:
    """A dozen lines that become 10 to the 12th values."""
    width, depth = _some(rng, 3, 10, 30), _some(rng, 8, 12, 25)
    lines = ["a0: &a0 [" + ", ".join(["lol"] * width) + "]"]
    lines += [f"a{i}: &a{i} [" + ", ".join([f"*a{i - 1}"] * width) + "]" for i in range(1, depth)]
    return ("\n".join(lines) + f"\nname: *a{depth - 1}\n").encode()


def alias_in_itself(_: list[bytes], rng: np.random.Generator) -> bytes:
    """A collection that holds itself, as value or as key."""
    return [b"&a [*a, *a]", b"name: &a {x: *a}\n", b"&a {? *a : 1}", b"arms: &a\n  - *a\n", b"rest: {<<: &a {<<: *a}}"][
        _some(rng, 0, 1, 2, 3, 4)
    ]


def deep_yaml(_: list[bytes], rng: np.random.Generator) -> bytes:
    """Thousands of levels."""
    count = _some(rng, 90, 300, 5_000, 60_000)
    return [b"[" * count, b"arms: " + b"{a: " * count, b"- " * count, b"? " * count][_some(rng, 0, 1, 2, 3)]


def large_yaml(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """A good file with megabytes of more keys, or a number of 5,000 digits."""
    if rng.random() < 0.5:
        return samples[0] + b"\nheight: " + b"9" * 5_000 + b"\n"
    return samples[0] + b"".join(b"k%d: [1, 2, 3]\n" % i for i in range(_some(rng, 9_000, 60_000)))


def merge_keys(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Merge keys that multiply, of lists, of themselves, or of what is no mapping."""
    count = _some(rng, 10, 200, 3_000)
    which = _some(rng, 0, 1, 2, 3)
    if which == 0:
        lines = [b"a0: &a0 {x0: 1, y0: 2}"]
        lines += [b"a%d: &a%d {<<: [*a%d, *a%d], x%d: 1}" % (i, i, i - 1, i - 1, i) for i in range(1, min(count, 60))]
        return b"\n".join(lines)
    if which == 1:
        return samples[0] + b"\nm: &m {k: 1}\nn: {<<: [" + b", ".join([b"*m"] * count) + b"]}\n"
    if which == 2:
        return b"<<: 3\n" + samples[0]
    return b"a: &a {b: 1}\n" + b"".join(b"k%d: {<<: *a, <<: *a, ? {<<: *a} : 1}\n" % i for i in range(count))


# URDF


def _urdf(joints: list[tuple[str, str]], links: set[str], extra: str = "") -> bytes:
    text = [f'<?xml version="1.0"?>{extra}<robot name="r">', *(f'<link name="{link}"/>' for link in sorted(links))]
    text += [
        f'<joint name="j{i}" type="revolute"><parent link="{a}"/><child link="{b}"/><axis xyz="0 0 1"/>'
        f'<origin xyz="0 0 0.1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>'
        for i, (a, b) in enumerate(joints)
    ]
    return "\n".join([*text, "</robot>"]).encode()


def urdf_chain(_: list[bytes], rng: np.random.Generator) -> bytes:
    """Links behind one another."""
    count = _some(rng, 50, 130, 590, 5_000, 40_000)
    joints = [(f"l{i}", f"l{i + 1}") for i in range(count)]
    return _urdf(joints, {f"l{i}" for i in range(count + 1)})


def urdf_circle(_: list[bytes], rng: np.random.Generator) -> bytes:
    """Joints that come back to where they began, with and without a root beside them."""
    count = _some(rng, 1, 2, 20, 500)
    joints = [(f"l{i}", f"l{(i + 1) % count}") for i in range(count)]
    if rng.random() < 0.5:
        joints.append(("root", "hand"))
    if rng.random() < 0.3:
        joints.append(("root", "l0"))
    return _urdf(joints, {name for pair in joints for name in pair})


def urdf_star(_: list[bytes], rng: np.random.Generator) -> bytes:
    """A thousand joints on one link."""
    count = _some(rng, 100, 599, 1_000, 20_000)
    return _urdf([("root", f"l{i}") for i in range(count)], {"root", *(f"l{i}" for i in range(count))})


def urdf_odd(_: list[bytes], rng: np.random.Generator) -> bytes:
    """Entities that multiply, deep nesting, absurd numbers, names that are missing or doubled."""
    which = _some(rng, 0, 1, 2, 3, 4, 5)
    good = [("a", "b"), ("b", "c")]
    if which == 0:
        entities = (
            "<!DOCTYPE r [<!ENTITY a0 'x'>"
            + "".join(f"<!ENTITY a{i} '{f'&a{i - 1};' * 10}'>" for i in range(1, 12))
            + "]>"
        )
        return _urdf(good, {"a", "b", "c", "&a11;"}, entities)
    if which == 1:
        return b"<robot name='r'>" + b"<link name='x'>" * _some(rng, 90, 3_000, 100_000)
    if which == 2:
        return _urdf(good, {"a", "b", "c"}).replace(b"0 0 0.1", b"9" * 5_000 + b" 1e999 nan")
    if which == 3:
        return _urdf(good, {"a", "b", "c"}).replace(
            b'lower="-1"', [b'lower="nan"', b'lower="1e308"', b""][_some(rng, 0, 1, 2)]
        )
    if which == 4:
        return _urdf([("a", "b"), ("c", "b")], {"a", "b", "c"})
    return _urdf([("a", ""), ("", "b"), ("zzz", "yyy")], {"a", "b"})
