"""Matching the joint names of many tools to the joints that this library knows."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterable, Sequence

from syda_gym.errors import nearest_name

__all__ = ["JOINTS", "match_indices", "match_joints", "missing_hint", "side_and_rest"]

# Canonical joint (without side) to the names it goes by, best first. Where a tool has both a collar called "shoulder"
# and an upper arm called "arm" (CMU, Mixamo, LAFAN), our shoulder is the root of the upper arm; where it has no arm
# (Kinect, MediaPipe, OpenNI) our shoulder is its "shoulder".
_SIDED: dict[str, tuple[str, ...]] = {
    "Shoulder": (
        "arm", "upperarm", "uparm", "uarm", "armupper", "armup", "humerus", "shldrbend", "upperarmbend",
        "shoulderjoint",
        "shoulder", "shldr", "bicep", "biceps", "oberarm", "sho",
    ),
    "Elbow": (
        "forearm", "lowerarm", "lowarm", "loarm", "farm", "armlower", "armlow", "armfore", "forearmbend",
        "lowerarmbend", "forarm",
        "elbow", "elbowjoint", "radius", "ulna", "unterarm", "elb",
    ),
    "Hand": ("wrist", "hand", "palm", "wri", "handjoint", "wristjoint"),
    "Hip": ("upleg", "upperleg", "uleg", "legupper", "thigh", "thighbend", "femur", "hip", "hipjoint", "oberschenkel"),
    "Knee": ("leg", "lowerleg", "loleg", "lowleg", "lleg", "leglower", "shin", "shinbend", "calf", "tibia", "knee",
    "unterschenkel",
             "kne"),
    "Foot": ("ankle", "foot", "ank", "fuss"),
    "Toe": ("toebase", "toe", "footindex", "ball", "toes", "bigtoe", "foottip", "foottoe"),
}  # fmt: skip
_CENTRAL: dict[str, tuple[str, ...]] = {
    "Head": ("head", "skull", "kopf", "nose"),
    "Neck": ("neck", "shouldercenter", "shouldercentre", "spineshoulder", "neck1", "necklower", "lowerneck", "thorax",
    "hals"),
    "Torso": (
        "torso", "spinemid", "spinenavel", "spinemiddle", "spine1", "spine", "spinechest", "chest", "abdomen", "ab",
        "abdomenlower",
        "waist", "belly", "trunk",
    ),
    "Pelvis": ("hips", "pelvis", "hip", "hipcenter", "hipcentre", "spinebase", "root", "midhip", "lowerback", "becken"),
    "Nose": ("nose",),
}  # fmt: skip

JOINTS = tuple(side + joint for joint in _SIDED for side in "LR") + tuple(_CENTRAL)
"""Joints that readers look for: left and right arms and legs, then the trunk."""

_ARM = ("Shoulder", "Elbow", "Hand")
_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z][a-z]*|[a-z]+|\d+|[^\W\d_A-Za-z]+")
_SIDES = {"left": "L", "right": "R", "l": "L", "r": "R", "lft": "L", "rgt": "R", "lt": "L", "rt": "R", "links": "L",
          "rechts": "R"}  # fmt: skip
_NOISE = {
    "mixamorig", "mixamo", "character", "skel", "skeleton", "bip", "biped", "valvebiped", "bone", "def", "org", "mch",
    "joint",
    "jnt", "j", "bnd", "ccbase", "cc", "base", "m", "b", "c", "ctrl", "tracker", "body", "part", "marker", "pose",
    "landmark",
    "landmarks", "k4abt", "kinect", "xsens", "keypoint",
}  # fmt: skip
# MikuMikuDance writes its bones in Japanese; longer words stand first.
_JAPANESE = (
    ("左", "left "), ("右", "right "), ("手首", "wrist "), ("足首", "ankle "), ("つま先", "toe "), ("ひじ", "elbow "),
    ("ひざ", "knee "), ("腕", "arm "), ("肩", "collar "), ("足", "upleg "), ("頭", "head "), ("首", "neck "),
    ("上半身", "torso "), ("下半身", "pelvis "),
)  # fmt: skip
_LONGEST_NAME = 200
_SHARED = 0.8  # share of names that begin alike for the beginning to be a prefix


def match_joints(names: Sequence[str]) -> dict[str, str]:
    """Finds which of the given names is which joint.

    Understands camel case, separators, name spaces, left or right as a word or a letter at either end, a prefix or an
    ending that all names share, and numbers behind a name.

    Args:
        names: joint names as they stand in a file.

    Returns:
        Canonical joint (``LShoulder``, ``Head``, ...) to the name in the file; joints that are not found are left out.
    """
    return {joint: names[index] for joint, index in match_indices(names).items()}


def match_indices(names: Sequence[str], parents: Sequence[int] | None = None) -> dict[str, int]:
    """Finds which of the given names is which joint.

    Args:
        names: joint names as they stand in a file.
        parents: index of each joint's parent, -1 for a root; an elbow is then looked for below its shoulder, and so on.

    Returns:
        Canonical joint to index; joints that are not found are left out.
    """
    keyed: dict[tuple[str, str], int] = {}
    for index, keys in enumerate(_all_keys(names)):
        for key in keys:
            keyed.setdefault(key, index)
    found = {}
    for joint, synonyms in _SIDED.items():
        for side in "LR":
            match = next((keyed[side, part] for part in synonyms if (side, part) in keyed), None)
            if match is not None:
                found[side + joint] = match
    for joint, synonyms in _CENTRAL.items():
        match = next((keyed["", part] for part in synonyms if ("", part) in keyed), None)
        if match is not None:
            found[joint] = match
    for side in "LR":
        if parents is not None:
            found |= _chain(side, keyed, parents, found)
        ankle, foot = keyed.get((side, "ankle")), keyed.get((side, "foot"))
        if ankle is not None and foot is not None and f"{side}Toe" not in found:
            found[f"{side}Toe"] = foot  # Kinect: the ankle is a joint of its own, the foot lies before it
    return found


def missing_hint(joint: str, names: Iterable[str]) -> str:
    """What to say about an arm joint that no name matched: how it may be called, and the nearest name in the file."""
    side = "Left" if joint[0] == "L" else "Right"
    synonyms = ", ".join(side + part.capitalize() for part in _SIDED[joint[1:]][:14])
    shown = [name[:40] for name in itertools.islice(names, 80)]
    return (
        f"it may be called {synonyms} (or with L_, _l, .L and the like); {nearest_name(side + joint[1:], shown)}. "
        f"Say it "
        f"with --joints {joint}=NAME"
    )


def side_and_rest(name: str) -> tuple[str, str]:
    """Side (``L``, ``R`` or none) and the rest in lower case without separators, for example ``("L", "forearm")``."""
    return _keys(_words(name))[0]


def _chain(
    side: str, keyed: dict[tuple[str, str], int], parents: Sequence[int], found: dict[str, int]
) -> dict[str, int]:
    """Shoulder, elbow and hand that hang below one another, the best names first."""
    choices = [[keyed[side, part] for part in _SIDED[joint] if (side, part) in keyed] for joint in _ARM]
    first = [found.get(side + joint) for joint in _ARM]
    for indices in sorted(itertools.product(*choices), key=lambda chosen: sum(map(list.index, choices, chosen))):
        if _below(indices[0], indices[1], parents) and _below(indices[1], indices[2], parents):
            return {side + joint: index for joint, index in zip(_ARM, indices, strict=True)}
    return {side + joint: index for joint, index in zip(_ARM, first, strict=True) if index is not None}


def _below(upper: int, lower: int, parents: Sequence[int]) -> bool:
    index = parents[lower]
    while index >= 0 and index != upper:
        index = parents[index]
    return index == upper


def _words(name: str) -> list[str]:
    text = name[:_LONGEST_NAME]
    for word, translation in _JAPANESE:
        text = text.replace(word, translation)
    return [word.lower() for word in _WORDS.findall(re.split(r"[:|]", text)[-1])]


def _all_keys(names: Sequence[str]) -> list[list[tuple[str, str]]]:
    words = _without_shared([_words(name) for name in names])
    return [_keys(row) if row else [] for row in words]


def _without_shared(rows: list[list[str]]) -> list[list[str]]:
    """Words without the beginning and the ending that nearly all names share."""
    for last in (False, True):
        while True:
            ends = Counter(row[-1 if last else 0] for row in rows if len(row) > 1)
            word, count = ends.most_common(1)[0] if ends else ("", 0)
            if count < max(3, _SHARED * sum(bool(row) for row in rows)) or word in _SIDES or (last and word.isdigit()):
                break
            rows = [
                (row[:-1] if last else row[1:]) if len(row) > 1 and row[-1 if last else 0] == word else row
                for row in rows
            ]
    return rows


def _keys(words: list[str]) -> list[tuple[str, str]]:
    """What a name may stand for, likeliest first."""
    kept = _without_noise(words)
    side, rest = "", []
    for index, word in enumerate(kept):
        letter = len(word) > 1 or index in (0, len(kept) - 1) or len(kept) > 2
        if not side and word in _SIDES and letter and len(kept) > 1:
            side = _SIDES[word]
        else:
            rest.append(word)
    joined = "".join(rest)
    keys = []
    if not side:
        keys += _glued(joined)
    keys.append((side, joined))
    bare = joined.rstrip("0123456789")
    if bare and bare != joined:
        if not side:
            keys += _glued(bare)
        keys.append((side, bare))
    return keys


def _without_noise(words: list[str]) -> list[str]:
    kept: list[str] = []
    for index, word in enumerate(words):
        after_noise = index > 0 and words[index - 1] in _NOISE and word.isdigit()
        if (word in _NOISE and not (word == "joint" and kept)) or after_noise:
            continue
        kept.append(word)
    while len(kept) > 1 and kept[0].isdigit():
        kept = kept[1:]
    return kept or words


_ALL_SIDED = {part for synonyms in _SIDED.values() for part in synonyms}


def _glued(joined: str) -> list[tuple[str, str]]:
    """Left or right written together with the rest: ``lshoulder``, ``leftarm``, ``handr``."""
    bare = joined.rstrip("0123456789")
    for start, side in (("left", "L"), ("right", "R")):
        if bare.startswith(start) and len(bare) > len(start):
            return [(side, bare.removeprefix(start))]
        if bare.endswith(start) and len(bare) > len(start):
            return [(side, bare.removesuffix(start))]
    for letter, side in (("l", "L"), ("r", "R")):
        for rest in (bare.removeprefix(letter) if bare.startswith(letter) else "",
                     bare.removesuffix(letter) if bare.endswith(letter) else ""):  # fmt: skip
            if rest in _ALL_SIDED and bare not in _ALL_SIDED:
                return [(side, rest)]
    return []
