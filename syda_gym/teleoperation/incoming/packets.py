"""Packets: operator frames and requests as JSON, read from a network that may send anything."""

from __future__ import annotations

import hmac
import json
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from syda_gym.embodiments.embodiment import Embodiment, FloatArray
from syda_gym.embodiments.human import SKELETON_JOINTS, HumanSkeleton
from syda_gym.errors import TeleoperationError, nearest_name
from syda_gym.teleoperation.tick import CONTROLS

__all__ = ["MAX_BYTES", "VERSION", "Packet", "PacketDecoder", "PacketError", "encode_frame", "encode_request"]

VERSION = 1
MAX_BYTES = 16_384
"""Larger packets are dropped unread; a frame of 15 joints takes about 1,000 bytes."""

_MAX_SEQUENCE = 2**53
_MAX_VALUE = 1e6
_NUMBERS = frozenset({int, float})
_KEYS = frozenset({"v", "seq", "t", "token", "frame", "joints", "confidence", "control"})


class PacketError(TeleoperationError):
    """A packet was dropped.

    Attributes:
        reason: one word for the statistics, such as ``oversized`` or ``token``.
    """

    def __init__(self, reason: str, message: str) -> None:
        super().__init__(message)
        self.reason = reason


@dataclass(frozen=True, slots=True, eq=False)
class Packet:
    """One packet that passed all checks.

    Attributes:
        sequence: number given by the sender, growing.
        sent: the sender's clock [s].
        frame: ``(F,)`` in the source's unit and axes, or ``None``.
        tracking: the sender's confidence in the frame, 0 to 1.
        control: a request, or ``None``.
    """

    sequence: int
    sent: float
    frame: FloatArray | None = None
    tracking: float = 1.0
    control: str | None = None


class PacketDecoder:
    """Reads packets for one body and rejects everything else.

    A packet is a JSON object of at most ``MAX_BYTES`` bytes with ``v`` (1), ``seq`` (integer), ``t`` (sender's
    seconds), ``token`` (where one is required) and exactly one of ``frame`` (the body's numbers in order), ``joints``
    (name to numbers: x, y, z of a human's joint, or one angle of a robot's) and ``control`` (one of ``CONTROLS``).
    ``confidence`` is optional: one number from 0 to 1, or one per joint, of which the least counts.

    Args:
        body: whose frames arrive.
        token: secret that every packet must carry, or ``None``.
    """

    def __init__(self, body: Embodiment, token: str | None = None) -> None:
        self.body = body
        self._token = None if token is None else token.encode()
        if isinstance(body, HumanSkeleton):
            self._joints: tuple[str, ...] = body.feature_joints
            self._known = frozenset(SKELETON_JOINTS)
            self._per_joint = 3
        else:
            self._joints = tuple(feature.name for feature in body.features)
            self._known = frozenset(self._joints)
            self._per_joint = 1

    def __call__(self, data: bytes | str) -> Packet:
        """Decodes one packet.

        Raises:
            PacketError: the packet is to be dropped; the message says what was expected and what came.
        """
        value = _parse(data)
        self._check_token(value)
        sequence, sent = _header(value)
        content = [key for key in ("frame", "joints", "control") if key in value]
        if len(content) != 1:
            raise PacketError("content", f"expected exactly one of frame, joints, control; got {content or 'none'}")
        if "control" in value:
            control = value["control"]
            if not isinstance(control, str) or control not in CONTROLS:
                raise PacketError(
                    "control", f"unknown control {str(control)[:40]!r}; {nearest_name(str(control)[:40], CONTROLS)}"
                )
            return Packet(sequence, sent, control=control)
        numbers = self._named(value["joints"]) if "joints" in value else value["frame"]
        tracking = _tracking(value["confidence"]) if "confidence" in value else 1.0
        return Packet(sequence, sent, self._frame(numbers), tracking)

    def _check_token(self, value: dict[str, Any]) -> None:
        if self._token is None:
            return
        given = value.get("token")
        # Constant time, so that the answer's delay does not spell the token.
        if not isinstance(given, str) or not hmac.compare_digest(_bytes(given), self._token):
            raise PacketError("token", "the packet's token is missing or wrong; give the sender the listener's token")

    def _named(self, joints: Any) -> list[Any]:
        if not isinstance(joints, dict):
            raise PacketError("joints", f"joints must be an object of name: numbers, got {type(joints).__name__}")
        for name in joints:
            if name not in self._known:
                raise PacketError("joints", f"unknown joint {name[:40]!r}; {nearest_name(name[:40], self._known)}")
        numbers: list[Any] = []
        for name in self._joints:
            if name not in joints:
                raise PacketError("joints", f"joint {name!r} is missing; needed: {', '.join(self._joints)}")
            part = joints[name]
            if self._per_joint == 1:
                numbers.append(part)
            elif isinstance(part, list) and len(part) == self._per_joint:
                numbers += part
            else:
                raise PacketError("joints", f"joint {name!r} needs {self._per_joint} numbers x, y, z")
        return numbers

    def _frame(self, numbers: Any) -> FloatArray:
        if not isinstance(numbers, list) or len(numbers) != self.body.n_features:
            count = len(numbers) if isinstance(numbers, list) else type(numbers).__name__
            raise PacketError("shape", f"a frame of {self.body.name!r} has {self.body.n_features} numbers, got {count}")
        if not (_NUMBERS.issuperset(map(type, numbers)) and -_MAX_VALUE <= min(numbers) <= max(numbers) <= _MAX_VALUE):
            wrong = next(i for i, n in enumerate(numbers) if not (_is_number(n) and abs(n) <= _MAX_VALUE))
            name = self.body.features[wrong].name
            raise PacketError("value", f"feature {name!r} must be a finite number up to {_MAX_VALUE:g}")
        return np.array(numbers, dtype=np.float64)


def encode_frame(
    sequence: int, sent: float, frame: FloatArray | list[float], *, token: str | None = None, confidence: float = 1.0
) -> bytes:
    """A packet with one frame ``(F,)``, as a sender writes it."""
    value: dict[str, Any] = {"v": VERSION, "seq": int(sequence), "t": float(sent), "frame": np.asarray(frame).tolist()}
    if confidence != 1.0:
        value["confidence"] = float(confidence)
    return _encode(value, token)


def encode_request(sequence: int, sent: float, control: str, *, token: str | None = None) -> bytes:
    """A packet with one request out of ``CONTROLS``."""
    return _encode({"v": VERSION, "seq": int(sequence), "t": float(sent), "control": control}, token)


def _encode(value: dict[str, Any], token: str | None) -> bytes:
    if token is not None:
        value["token"] = token
    return json.dumps(value, separators=(",", ":")).encode()


def _parse(data: bytes | str) -> dict[str, Any]:
    if len(data) > MAX_BYTES:
        raise PacketError("oversized", f"packet of {len(data)} bytes; up to {MAX_BYTES} are read")
    try:
        text = data if isinstance(data, str) else data.decode("utf-8")
        value = _JSON.decode(text)
    except PacketError:
        raise
    except (ValueError, RecursionError) as error:
        raise PacketError("json", f"not JSON: {str(error)[:100]}") from error
    if not isinstance(value, dict):
        raise PacketError("json", f"expected a JSON object, got {type(value).__name__}")
    if not _KEYS.issuperset(value):
        key = next(key for key in value if key not in _KEYS)[:40]
        raise PacketError("key", f"unknown key {key!r}; {nearest_name(key, _KEYS)}")
    if value.get("v") != VERSION:
        raise PacketError("version", f"expected version v = {VERSION}, got {str(value.get('v'))[:40]}")
    return value


def _no_constant(name: str) -> float:
    raise PacketError("value", f"{name} is not allowed; leave out frames that are not complete")


_JSON = json.JSONDecoder(parse_constant=_no_constant)  # made once; ``json.loads`` would make one per packet


def _header(value: dict[str, Any]) -> tuple[int, float]:
    sequence, sent = value.get("seq"), value.get("t")
    if not isinstance(sequence, int) or isinstance(sequence, bool) or not 0 <= sequence < _MAX_SEQUENCE:
        raise PacketError("sequence", "seq must be an integer from 0 to 2^53")
    if not isinstance(sent, int | float) or not _is_number(sent) or not abs(sent) < 1e12:
        raise PacketError("time", "t must be the sender's time in seconds, a finite number")
    return sequence, float(sent)


def _tracking(value: Any) -> float:
    values = list(value.values()) if isinstance(value, dict) else [value]
    if not values or not all(_is_number(one) and 0.0 <= one <= 1.0 for one in values):
        raise PacketError("confidence", "confidence must be a number from 0 to 1, or one per joint")
    return float(min(values))


def _is_number(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1 << 60


def _bytes(text: str) -> bytes:
    return text.encode("utf-8", "surrogatepass")
