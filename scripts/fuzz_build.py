"""Files that are built to hurt: circles, aliases that multiply, deep chains, sizes that disagree, huge archives.

Damage to a good file hardly ever makes one of these. Each builder makes one input from the good samples and a
generator, small on the disk and large in whoever reads it without measuring first.
"""

from __future__ import annotations

import io
import json
import struct
import zipfile
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from fuzz_trees import (
    alias_in_itself,
    aliases,
    deep_yaml,
    large_yaml,
    merge_keys,
    urdf_chain,
    urdf_circle,
    urdf_odd,
    urdf_star,
)

__all__ = ["BUILDERS", "Builder"]

Builder = Callable[[list[bytes], np.random.Generator], bytes]
"""From valid samples and a generator to one input."""


def _some(rng: np.random.Generator, *values: int) -> int:
    return int(rng.choice(values))


# JSON


def deep_json(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Thousands of levels, alone or where a value was."""
    count = _some(rng, 200, 990, 50_000)
    nest = rng.choice(np.array(["[", '{"a":', '{"members":[', '{"there":{"kind":"two_way","settings":'])) * count
    text = samples[0].decode("utf-8", "replace")
    if rng.random() < 0.5 or "null" not in text:
        return str(nest).encode()
    close = {"[": "]", '{"a":': "}", '{"members":[': "]}"}.get(nest[: len(nest) // count], "}}")
    return text.replace("null", nest + "1" + close * count, 1).encode()


def long_numbers(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Numbers of 400 or 5,000 digits where small ones stood."""
    digits = "9" * _some(rng, 305, 400, 5_000)
    text = samples[0].decode("utf-8", "replace")
    places = [i for i, c in enumerate(text[:20_000]) if c.isdigit() and not text[i - 1 : i].isdigit()]
    if not places:
        return digits.encode()
    place = int(rng.choice(places))
    return (text[:place] + digits + text[place:]).encode()


def many_values(_: list[bytes], rng: np.random.Generator) -> bytes:
    """Millions of empty lists."""
    return b"[" + b"[]," * _some(rng, 10_000, 5_500_000) + b"[]]"


# cards of mappings and agents


def _changed(sample: bytes, change: Callable[[dict[str, Any]], None]) -> bytes:
    content = json.loads(sample)
    change(content)
    return json.dumps(content).encode()


def card_numbers(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Bounds, gains, widths and thresholds that would switch off the live slowing down, or ask for gigabytes."""
    bad = [-1.0, -1e-9, float("nan"), float("inf"), 1e300, -0.5, 10**25, "1", None, True, [1.0], 1e-300, 11.0]

    def change(content: dict[str, Any]) -> None:
        for link in content["links"]:
            confidence = link.get("confidence") or {"bound": 0.1, "gain": 1.0, "width": 1.0, "threshold": 0.5}
            for key in ("bound", "gain", "width", "threshold"):
                if rng.random() < 0.4:
                    confidence[key] = bad[int(rng.integers(len(bad)))]
            link["confidence"] = confidence

    return _changed(samples[0], change)


def card_sizes(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Windows, neighbours and chains of absurd length."""
    huge = _some(rng, 251, 10**6, 10**9, 2**40)

    def change(content: dict[str, Any]) -> None:
        link = content["links"][0]
        which = _some(rng, 0, 1, 2, 3)
        if which == 0:
            inner = link["source_coder"].get("settings", {})
            link["source_coder"] = {"kind": "window", "settings": {"window": huge, "inner": inner}}
        elif which == 1:
            content["links"] = content["links"] * _some(rng, 17, 1_000)
        elif which == 2:
            link["regressor"]["settings"] = {
                **link["regressor"].get("settings", {}),
                "neighbours": huge,
                "gamma": float("nan"),
                "slope": 1e308,
            }
        else:
            members = [link["regressor"]] * _some(rng, 2, 500)
            link["regressor"] = {"kind": "mean", "settings": {"members": members, "columns": [[0, huge]] * len(members),
                                                              "on_identity": [True] * len(members)}}  # fmt: skip

    return _changed(samples[0], change)


def deep_stack(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Hundreds of agents on top of one another."""

    def change(content: dict[str, Any]) -> None:
        content["stack"] = [content["stack"][0]] + [{"agent": "ema", "settings": {}}] * _some(rng, 15, 17, 990, 20_000)

    return _changed(samples[0], change)


# weights


def _tensors(entries: Mapping[str, tuple[str, list[int], bytes]], length: int | None = None) -> bytes:
    table: dict[str, Any] = {}
    data = b""
    for name, (kind, shape, content) in entries.items():
        table[name] = {"dtype": kind, "shape": shape, "data_offsets": [len(data), len(data) + len(content)]}
        data += content
    header = json.dumps(table).encode()
    return struct.pack("<Q", len(header) if length is None else length) + header + data


def _entries(sample: bytes) -> dict[str, tuple[str, list[int], bytes]]:
    length = struct.unpack("<Q", sample[:8])[0]
    table = json.loads(sample[8 : 8 + length])
    table.pop("__metadata__", None)
    body = sample[8 + length :]
    return {
        name: (e["dtype"], e["shape"], body[e["data_offsets"][0] : e["data_offsets"][1]]) for name, e in table.items()
    }


_SIZES = {"F64": 8, "F32": 4, "BF16": 2, "F16": 2, "F8_E4M3": 1, "I64": 8}


def other_sizes(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Good names, other shapes: vectors of 60,000, rows turned into columns, nothing at all, spreads of zero."""
    entries = _entries(samples[int(rng.integers(len(samples)))])
    for name in list(entries):
        if rng.random() > 0.5:
            continue
        kind, shape, content = entries[name]
        side = _some(rng, 0, 1, 7, 60_000, 300_000)
        change = _some(rng, 0, 1, 2, 3)
        if change == 0:
            entries[name] = (kind, [side], b"\0" * (_SIZES.get(kind, 4) * side))
        elif change == 1:
            entries[name] = (kind, shape[::-1], content)
        elif change == 2:
            entries[name] = (kind, [*shape, 1], content)
        else:
            entries[name] = (kind, shape, b"\0" * len(content))
    return _tensors(entries)


def zero_spreads(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Good weights in which one table of positive numbers holds a zero, a negative or no number at all."""
    entries = _entries(samples[int(rng.integers(len(samples)))])
    names = [name for name in entries if any(word in name for word in ("std", "spread", "scale", "sd"))]
    name = str(rng.choice(np.array(names or sorted(entries))))
    kind, shape, content = entries[name]
    values = np.frombuffer(content, dtype={"F64": "<f8", "F32": "<f4"}.get(kind, "<f4")).copy()
    bad = [0.0, -1.0, np.nan, np.inf, 0.0][_some(rng, 0, 1, 2, 3, 4)]
    if rng.random() < 0.5 or not len(values):
        values[:] = bad
    else:
        values[int(rng.integers(len(values)))] = bad
    entries[name] = (kind, shape, values.tobytes())
    return _tensors(entries)


def other_types(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Types of numbers that numpy has not, or that are not floats."""
    entries = _entries(samples[0])
    kind = str(rng.choice(np.array(["BF16", "F8_E4M3", "I64", "F16", "F4", "BOOL"])))
    size = _SIZES.get(kind, 1)
    return _tensors(
        {name: (kind, shape, b"\1" * (size * int(np.prod(shape)))) for name, (_, shape, _) in entries.items()}
    )


def odd_tables(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Tables of wrong length, thousands of tensors, offsets outside of the file."""
    which = _some(rng, 0, 1, 2, 3)
    if which == 0:
        return _tensors(_entries(samples[0]), length=_some(rng, 0, 1, 2**31, 2**63 - 1))
    if which == 1:
        return _tensors({f"{i}/x": ("F64", [0], b"") for i in range(_some(rng, 3_999, 4_001, 60_000))})
    if which == 2:
        header = json.dumps(
            {"0/x": {"dtype": "F64", "shape": [10**6, 10**6], "data_offsets": [0, 8 * 10**12]}}
        ).encode()
        return struct.pack("<Q", len(header)) + header
    header = b'{"x":' * 990 + b"1" + b"}" * 990
    return struct.pack("<Q", len(header)) + header


# archives


def _zip(members: Mapping[str, bytes], kind: int = zipfile.ZIP_DEFLATED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", kind) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def _npy(shape: str, kind: str = "<f8", data: bytes = b"") -> bytes:
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + data


_BOMB: list[bytes] = []


def npz_bomb(_: list[bytes], rng: np.random.Generator) -> bytes:
    """A megabyte that unpacks to a gigabyte."""
    if not _BOMB:
        buffer = io.BytesIO()
        with (
            zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive,
            archive.open("landmarks.npy", "w", force_zip64=True) as member,
        ):
            member.write(_npy("(1342177, 100)"))
            for _block in range(64):
                member.write(bytes(2**24))
        _BOMB.append(buffer.getvalue())
    return _BOMB[0]


def npz_shapes(_: list[bytes], rng: np.random.Generator) -> bytes:
    """Headers whose shapes have nothing to do with the bytes, objects, thousands of members."""
    which = _some(rng, 0, 1, 2, 3, 4)
    shape = str(
        rng.choice(
            np.array(
                ["(1000000000000, 33, 3)", "(-1, 33, 3)", "(4, 33, 3)", "()", "(0, 33, 3)", "(33,)" * 30, "('a',)"]
            )
        )
    )
    kind = str(rng.choice(np.array(["<f8", "|O", "<U100000", ">f4", "|V8", "<c16", "<i8", "|S9"])))
    name = str(rng.choice(np.array(["landmarks", "meta", "x", "frames_0", "../../x"])))
    if which == 0:
        return _zip({f"{i}.npy": _npy("()") for i in range(_some(rng, 2_000, 12_000))}, zipfile.ZIP_STORED)
    if which == 1:
        return _zip({f"{name}.npy": _npy(shape, kind, bytes(_some(rng, 0, 8, 3_168)))})
    if which == 2:
        return _npy(shape, kind, bytes(_some(rng, 0, 8, 3_168)))
    if which == 3:
        points = rng.normal(size=(_some(rng, 1, 2, 30), _some(rng, 17, 22, 24, 25, 33, 52), _some(rng, 2, 3, 4)))
        rates = [
            np.array(0.0),
            np.array(float("nan")),
            np.array(1e-300),
            np.array(1e300),
            np.array([1.0, 2.0]),
            np.array("x"),
        ]
        buffer = io.BytesIO()
        np.savez(buffer, any=points * 10.0 ** _some(rng, -300, 0, 300), fps=rates[_some(rng, 0, 1, 2, 3, 4, 5)])
        return buffer.getvalue()
    return _zip({"meta.npy": _npy("(4,)", "|u1", b"[[[["), "frames_0.npy": _npy("(2, 18)", "<f8", bytes(288))})


def workbook_elsewhere(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """The sheets of a good workbook under another folder, with a cell far out, or with a size that is claimed."""
    with zipfile.ZipFile(io.BytesIO(samples[0])) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    far = [b"XFD1048576", b"A1048576", b"ZZ99999", b"CV30000", b"Z60000"][_some(rng, 0, 1, 2, 3, 4)]
    folder = [b"worksheets", b"sheets", b"secret"][_some(rng, 0, 1, 2)]
    result = {}
    for name, content in members.items():
        new = name.replace("worksheets/", folder.decode() + "/")
        changed = content.replace(b"worksheets/", folder + b"/")
        if "worksheets/" in name:
            which = _some(rng, 0, 1, 2)
            if which == 0:
                changed = changed.replace(
                    b"</sheetData>", b'<row r="9"><c r="' + far + b'"><v>1</v></c></row></sheetData>'
                )
            elif which == 1:
                changed = changed.replace(b"<sheetData>", b'<dimension ref="A1:' + far + b'"/><sheetData>', 1)
            else:
                changed = changed.replace(
                    b"</sheetData>", b"<row r='9'><c r='&#88;FD1048576'><v>1</v></c></row></sheetData>"
                )
        result[new] = changed
    return _zip(result)


def workbook_strings(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """One shared string of megabytes, in thousands of cells; or millions of strings; or one of very many runs."""
    with zipfile.ZipFile(io.BytesIO(samples[0])) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    which = _some(rng, 0, 1, 2)
    long, rows = _some(rng, 10_000, 3_000_000), _some(rng, 2, 30_000)
    item = b"<si><t>" + b"x" * long + b"</t></si>"
    if which == 1:
        item = b"<si><t>x</t></si>" * _some(rng, 100, 1_500_000)
    if which == 2:
        item = b"<si>" + b"<r><t>xxxxxxxx</t></r>" * _some(rng, 100, 200_000) + b"</si>"
    name = str(rng.choice(np.array(["xl/sharedStrings.xml", "xl/sharedStrings.xml", "xl/other.xml"])))
    members[name] = b'<?xml version="1.0"?><sst>' + item + b"</sst>"
    content = members["[Content_Types].xml"].replace(
        b"</Types>",
        b'<Override PartName="/%s" ContentType="application/vnd.openxmlformats-officedocument.spreadsheetml.'
        b'sharedStrings+xml"/></Types>' % name.encode(),
    )
    members["[Content_Types].xml"] = content
    rels = "xl/_rels/workbook.xml.rels"
    members[rels] = members[rels].replace(
        b"</Relationships>",
        b'<Relationship Id="rId999" Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/'
        b'sharedStrings" Target="%s"/></Relationships>' % name.removeprefix("xl/").encode(),
    )
    cells = b"".join(b'<row r="%d"><c r="A%d" t="s"><v>0</v></c></row>' % (i, i) for i in range(2, rows))
    for sheet in list(members):
        if "worksheets/sheet" in sheet:
            members[sheet] = members[sheet].replace(b"</sheetData>", cells + b"</sheetData>")
    return _zip(members)


# text of recordings


def bvh_deep(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Thousands of joints below one another, or beside one another."""
    count = _some(rng, 90, 120, 490, 5_000)
    joint = b"JOINT j\n{\nOFFSET 0 1 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
    body = joint * count + b"}" * count if rng.random() < 0.5 else (joint + b"}\n") * count
    return (
        b"HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        + body
        + b"\n}\nMOTION\nFrames: 2\nFrame Time: 0.03\n"
    )


def bvh_header(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Frames and frame times that nobody has."""
    frames = [b"Frames: 999999999", b"Frames: 0", b"Frames: -3", b"Frames: 1" + b"0" * 4_000][_some(rng, 0, 1, 2, 3)]
    times = [b"0", b"nan", b"1e-300", b"1/0", b"1/1e-320", b"-0.03", b"1e999", b"9" * 5_000][
        _some(rng, 0, 1, 2, 3, 4, 5, 6, 7)
    ]
    text = samples[0].replace(b"Frame Time: 0.0333333", b"Frame Time: " + times)
    return text.replace(b"Frames: 12", frames) if rng.random() < 0.5 else text


def wide_table(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Names of very many separators, very many columns, or very many numbers in a line."""
    which = _some(rng, 0, 1, 2, 3)
    if which == 0:
        name = str(rng.choice(np.array([" ", ".", "_", "pos", "position ", "x", "-", ":"]))) * _some(
            rng, 5_000, 100_000
        )
        return f"{name}!,a_x,a_y,a_z\n1,2,3,4\n1,2,3,4\n".encode()
    if which == 1:
        count = _some(rng, 500, 19_000, 60_000)
        return (
            ",".join(f"j{i}_x,j{i}_y,j{i}_z" for i in range(count // 3)) + "\n" + ("1," * count + "\n") * 3
        ).encode()
    if which == 2:
        return (b"1 " * _some(rng, 60, 3_000, 300_000) + b"\n") * 3
    rows = b"".join(b"%d,p%d,1,2,3\n" % (i, i) for i in range(_some(rng, 300, 5_000)))
    return b"frame,landmark,x,y,z\n" + rows


def odd_clock(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """A table of a person whose times are none."""
    joints = ["left_shoulder", "left_elbow", "left_wrist", "right_shoulder", "right_elbow", "right_wrist"]
    places = [(0.2, 0.5, 2.0), (0.5, 0.5, 2.0), (0.7, 0.5, 2.0), (-0.2, 0.5, 2.0), (-0.5, 0.5, 2.0), (-0.7, 0.5, 2.0)]
    head = "timestamp," + ",".join(f"{joint}_{axis}" for joint in joints for axis in "xyz")
    steps = [0.0, 1e-300, 1e-9, 1e9, 1e17, -1.0, float("nan"), 1e300, 10.0, 3.3e4]
    step = steps[_some(rng, *range(len(steps)))]
    start = [0.0, 1.7e9, 1.7e18, 6.4e17, -1e300][_some(rng, 0, 1, 2, 3, 4)]
    body = ",".join(f"{v}" for place in places for v in place)
    return "\n".join([head, *(f"{start + step * t!r},{body}" for t in range(_some(rng, 2, 5, 40)))]).encode()


def ntu_counts(_: list[bytes], rng: np.random.Generator) -> bytes:
    """Counts of frames, bodies and joints that the lines do not hold."""
    counts = [_some(rng, 0, 1, 10**6, 10**9) for _ in range(3)]
    joints = counts[2] if counts[2] < 30 else 25
    row = "0 0 0 0 0 0 0 0 0 0 0 2"
    return f"{counts[0]}\n{counts[1] % 7}\n7 0 1 1 1 1 0 0.1 0.1 2\n{joints}\n{row}\n".encode()


def _elsewhere(rng: np.random.Generator) -> Any:
    """A tensor that says it lies in a device, outside of the folder, or in a file of any size."""
    from onnx import TensorProto

    tensor = TensorProto(name="w", data_type=TensorProto.DOUBLE, data_location=TensorProto.EXTERNAL)
    tensor.dims.append(_some(rng, 3, 10**9))
    places = ["/dev/zero", "../../../../../../../etc/passwd", "agent.onnx", "", "x" * 5_000]
    values = {"location": places[_some(rng, 0, 1, 2, 3, 4)], "offset": str(_some(rng, 0, -1, 10**12))}
    values |= {"length": str(_some(rng, 24, 0, 10**12))}
    for key, value in values.items():
        entry = tensor.external_data.add()
        entry.key, entry.value = key, value
    return tensor


def onnx_cards(samples: list[bytes], rng: np.random.Generator) -> bytes:
    """Graphs that onnxruntime takes, with cards that say nothing, too much, or something else."""
    import onnx
    from onnx import TensorProto, helper

    port = helper.make_tensor_value_info("x", TensorProto.DOUBLE, [None, 3])
    nodes = [helper.make_node("Identity", ["x"], ["y"])]
    for index in range(_some(rng, 0, 0, 990)):
        nodes.append(helper.make_node("Identity", [f"y{index - 1}" if index else "y"], [f"y{index}"]))
    graph = helper.make_graph(nodes, "g", [port], [helper.make_tensor_value_info("y", TensorProto.DOUBLE, [None, 3])])
    if rng.random() < 0.3:  # numbers that lie in another file
        graph.initializer.append(_elsewhere(rng))
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    inputs: list[Any] = [
        [], None, [{"name": "observation", "shape": [1, 10**12]}], [{"name": "observation", "shape": [1, 3]}],
        [{"name": "x"}], "x",
        [{"name": n, "shape": [1, 3]} for n in ("observation", "state", "fresh")], [{"name": ["a"], "shape": [1, -5]}],
    ]  # fmt: skip
    cards = [
        "",
        "null",
        "[]",
        json.dumps({"inputs": inputs[_some(rng, *range(len(inputs)))]}),
        "{}",
        "[" * 50_000,
        '{"inputs": ' + "9" * 5_000 + "}",
    ]
    card = cards[_some(rng, 0, 1, 2, 3, 3, 3, 3, 4, 5, 6)]
    if card:
        helper.set_model_props(model, {"syda_gym": card})
    return onnx.ModelProto.SerializeToString(model)


_YAML = (aliases, alias_in_itself, deep_yaml, large_yaml, merge_keys)
_TEXT = (wide_table, odd_clock)
BUILDERS: dict[str, tuple[Builder, ...]] = {
    "robot-yaml": _YAML,
    "benchmark-yaml": _YAML,
    "robot-urdf": (urdf_chain, urdf_circle, urdf_star, urdf_odd),
    "mapping-card": (card_numbers, card_sizes, deep_json, long_numbers),
    "mapping-card-syda": (card_numbers, card_sizes, long_numbers),
    "mapping-weights-marked": (other_sizes, other_types, odd_tables, zero_spreads),
    "agent-card": (deep_stack, deep_json, long_numbers),
    "agent-weights": (other_sizes, other_types, odd_tables),
    "agent-policy-weights": (zero_spreads, other_sizes),
    "agent-checkpoint": (other_sizes, other_types, odd_tables),
    "agent-onnx": (onnx_cards,),
    "motions-npz": (npz_bomb, npz_shapes),
    "motions-keypoints": (npz_shapes, npz_bomb),
    "motions-paper": (workbook_elsewhere, workbook_strings),
    "motions-bvh": (bvh_deep, bvh_header),
    "motions-kinect": _TEXT,
    "motions-openni": _TEXT,
    "motions-table": (*_TEXT, ntu_counts),
    "motions-mediapipe": (deep_json, long_numbers, many_values),
    "motions-pairs-index": (deep_json, long_numbers),
    "motions-layout": _YAML,
}
"""Target to its builders."""
