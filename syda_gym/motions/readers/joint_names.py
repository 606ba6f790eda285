"""Matching the joint names of many tools to the joints that this library knows."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from syda_gym.errors import nearest_name

__all__ = ["JOINTS", "match_joints", "missing_hint"]

# Canonical joint (without side) to the names it goes by, best first. Where a tool has both a collar called "shoulder"
# and an upper arm called "arm" (CMU, Mixamo, LAFAN), our shoulder is the root of the upper arm; where it has no arm
# (Kinect, MediaPipe, OpenNI) our shoulder is its "shoulder".
_SIDED: dict[str, tuple[str, ...]] = {
    "Shoulder": ("arm", "upperarm", "uparm", "armupper", "humerus", "shoulderjoint", "shoulder", "shldr"),
    "Elbow": ("forearm", "lowerarm", "armlower", "loarm", "elbow", "radius", "ulna"),
    "Hand": ("wrist", "hand", "palm"),
    "Hip": ("upleg", "upperleg", "thigh", "femur", "hip", "hipjoint"),
    "Knee": ("leg", "lowerleg", "lowleg", "shin", "calf", "tibia", "knee"),
    "Foot": ("ankle", "foot"),
    "Toe": ("toebase", "toe", "footindex", "ball", "toes"),
}
_CENTRAL: dict[str, tuple[str, ...]] = {
    "Head": ("head", "skull", "nose"),
    "Neck": ("neck", "shouldercenter", "spineshoulder", "neck1"),
    "Torso": ("torso", "spinemid", "spine1", "spine", "chest", "abdomen", "waist"),
    "Pelvis": ("hips", "pelvis", "hipcenter", "spinebase", "root", "lowerback"),
    "Nose": ("nose",),
}

JOINTS = tuple(side + joint for joint in _SIDED for side in "LR") + tuple(_CENTRAL)
"""Joints that readers look for: left and right arms and legs, then the trunk."""

_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z][a-z]*|[a-z]+|\d+")
_PREFIXES = {"mixamorig", "mixamo", "character", "skel", "skeleton", "bip", "biped", "bone", "def", "joint", "jnt", "j"}


def match_joints(names: Sequence[str]) -> dict[str, str]:
    """Finds which of the given names is which joint.

    Understands camel case, separators, name spaces, and left or right as a word or a letter at either end.

    Args:
        names: joint names as they stand in a file.

    Returns:
        Canonical joint (``LShoulder``, ``Head``, ...) to the name in the file; joints that are not found are left out.
    """
    keyed: dict[tuple[str, str], str] = {}
    for name in names:
        keyed.setdefault(_key(name), name)
    found = {}
    for joint, synonyms in _SIDED.items():
        for side in "LR":
            match = _first(keyed, side, synonyms)
            if match is not None:
                found[side + joint] = match
    for joint, synonyms in _CENTRAL.items():
        match = _first(keyed, "", synonyms)
        if match is not None:
            found[joint] = match
    return found


def missing_hint(joint: str, names: Iterable[str]) -> str:
    """What to say about an arm joint that no name matched: how it may be called, and the nearest name in the file."""
    side = "Left" if joint[0] == "L" else "Right"
    synonyms = ", ".join(side + part.capitalize() for part in _SIDED[joint[1:]])
    return f"it may be called {synonyms} (or with L_, _l, .L and the like); {nearest_name(side + joint[1:], names)}"


def _first(keyed: dict[tuple[str, str], str], side: str, synonyms: Sequence[str]) -> str | None:
    return next((keyed[side, part] for part in synonyms if (side, part) in keyed), None)


def _key(name: str) -> tuple[str, str]:
    """Side (``L``, ``R`` or none) and the rest in lower case without separators, for example ``("L", "forearm")``."""
    words = [word.lower() for word in _WORDS.findall(re.split(r"[:|]", name)[-1])]
    while len(words) > 1 and (words[0] in _PREFIXES or (words[0].isdigit() and len(words) > 1)):
        words = words[1:]
    side = ""
    kept = []
    for index, word in enumerate(words):
        letter = word in ("l", "r") and index in (0, len(words) - 1)
        if not side and (word in ("left", "right") or letter):
            side = word[0].upper()
        else:
            kept.append(word)
    rest = "".join(kept)
    if not side:
        for start in ("left", "right"):
            if rest.startswith(start) or rest.endswith(start):
                return start[0].upper(), rest.removeprefix(start) if rest.startswith(start) else rest.removesuffix(
                    start
                )
    return side, rest
