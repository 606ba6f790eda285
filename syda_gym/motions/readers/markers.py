"""Joints from the markers of optical motion capture: the middle of the markers around a joint."""

from __future__ import annotations

from collections.abc import Sequence

from syda_gym.motions.readers.joint_names import match_indices

__all__ = ["joint_points"]

# Joint (without side) to sets of markers (without side) whose middle it is, best first: joint centres that the lab's
# software computed, then pairs of markers on both sides of the joint, then one marker. Names of Plug-in Gait, OpenSim's
# models, the ISB and Visual3D.
_SIDED: dict[str, tuple[tuple[str, ...], ...]] = {
    "Shoulder": (("SJC",), ("SHOULDERJC",), ("SHO",), ("ACR",), ("ACJ",), ("AC",), ("ACROMIUM",), ("ACROMION",),
    ("SHOULDER",)),
    "Elbow": (
        ("EJC",), ("ELBOWJC",), ("ELB", "ELBM"), ("ELB", "MELB"), ("LELB", "MELB"), ("ELBL", "ELBM"), ("LEL", "MEL"),
        ("LHE", "MHE"), ("LEP", "MEP"), ("HLE", "HME"), ("ELBOWLATERAL", "ELBOWMEDIAL"), ("ELBOWLAT", "ELBOWMED"),
        ("ELBOUT", "ELBIN"), ("ELB",), ("LEL",), ("LHE",), ("LEP",), ("HLE",), ("ELBOWLATERAL",), ("ELBOW",),
    ),
    "Hand": (
        ("WJC",), ("WRISTJC",), ("WRA", "WRB"), ("WRLAT", "WRMED"), ("WRISTLAT", "WRISTMED"), ("WRISTRADIUS",
        "WRISTULNA"),
        ("FARADIUS", "FAULNA"), ("RSP", "USP"), ("RS", "US"), ("WRR", "WRU"), ("WRT", "WRP"), ("IWR", "OWR"),
        ("WROUT", "WRIN"),
        ("WRISTOUT", "WRISTIN"), ("RAD", "ULN"), ("WRB",), ("WRA",), ("WRI",), ("WRT",), ("WRIST",), ("RAD",), ("ULN",),
    ),
    "Hip": (("HJC",), ("ASI",), ("ASIS",), ("IAS",), ("HIP",)),
    "Knee": (("KJC",), ("KNE", "KNM"), ("KNE", "MKNE"), ("KNEL", "KNEM"), ("LFC", "MFC"), ("LFE", "MFE"), ("FLE",
    "FME"), ("KNE",),
             ("KNEELATERAL", "KNEEMEDIAL"), ("LFC",), ("FLE",), ("KNEE",)),
    "Foot": (("AJC",), ("ANK", "MED"), ("ANK", "MANK"), ("LMAL", "MMAL"), ("FAL", "TAM"), ("ANK",), ("LMAL",), ("FAL",
    ), ("ANKLE",)),
    "Toe": (("TOE",), ("MT2",), ("FM2",), ("MT1", "MT5"), ("FM1", "FM5")),
}  # fmt: skip
_CENTRAL: dict[str, tuple[tuple[str, ...], ...]] = {
    "Head": (("LFHD", "RFHD", "LBHD", "RBHD"), ("LFHD", "RFHD"), ("TOPHEAD",), ("HEAD",), ("ARIEL",)),
    "Neck": (("C7", "CLAV"), ("C7", "SJN"), ("C7", "IJ"), ("CV7", "SJN"), ("C7",), ("CV7",), ("CLAV",)),
    "Torso": (("T10", "STRN"), ("TV10", "SXS"), ("T8", "PX"), ("TV8", "SXS"), ("T10",), ("STRN",)),
}  # fmt: skip


def joint_points(names: Sequence[str], parents: Sequence[int] | None = None) -> dict[str, tuple[int, ...]]:
    """Which points of a file make which joint.

    Args:
        names: names of joints or markers as they stand in the file.
        parents: see ``match_indices``.

    Returns:
        Canonical joint to the indices of the points whose middle it is; joints that are not found are left out.
    """
    found: dict[str, tuple[int, ...]] = {joint: (index,) for joint, index in match_indices(names, parents).items()}
    if parents is not None:
        return found
    places: dict[str, int] = {}
    for index, name in enumerate(names):
        places.setdefault("".join(c for c in name.rpartition(":")[2] if c.isalnum()).upper(), index)
    places.pop("", None)  # what has no letters is no marker, and stands for those that are missing below
    for joint, sets in _SIDED.items():
        for side in "LR":
            points = _first(places, [[_sided(places, side, one) for one in each] for each in sets])
            if points and (len(points) > 1 or side + joint not in found):
                found[side + joint] = points
    for joint, sets in _CENTRAL.items():
        points = _first(places, [list(each) for each in sets])
        if points and (len(points) > 1 or joint not in found):
            found[joint] = points
    return found


def _sided(places: dict[str, int], side: str, marker: str) -> str:
    return next((name for name in (side + marker, marker + side) if name in places), "")


def _first(places: dict[str, int], sets: list[list[str]]) -> tuple[int, ...]:
    return next((tuple(places[name] for name in names) for names in sets if all(name in places for name in names)), ())
