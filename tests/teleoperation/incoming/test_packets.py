"""The packet parser lets complete, finite, sized packets of the right token pass, and nothing else."""

from __future__ import annotations

import json
import math
import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from syda_gym.embodiments import catalog
from syda_gym.embodiments.human import HumanSkeleton
from syda_gym.embodiments.robot import Robot
from syda_gym.teleoperation.incoming.ordering import Ordering
from syda_gym.teleoperation.incoming.packets import (
    MAX_BYTES,
    Packet,
    PacketDecoder,
    PacketError,
    encode_frame,
    encode_request,
)

FRAME = [0.1 * i for i in range(18)]


def packet(**changes: object) -> bytes:
    value: dict[str, object] = {"v": 1, "seq": 3, "t": 1.5, "frame": FRAME}
    value.update(changes)
    return json.dumps({key: one for key, one in value.items() if one is not ...}).encode()


@pytest.fixture
def decoder(adult: HumanSkeleton) -> PacketDecoder:
    return PacketDecoder(adult)


def test_a_frame_arrives_as_it_was_sent(decoder: PacketDecoder) -> None:
    frame = np.random.default_rng(0).normal(size=18)
    got = decoder(encode_frame(7, 2.25, frame, confidence=0.5))
    assert got.frame is not None
    assert (got.frame == frame).all(), "bit for bit"
    assert (got.sequence, got.sent, got.tracking) == (7, 2.25, 0.5)
    assert decoder(encode_request(8, 2.5, "stop")).control == "stop"


def test_joints_by_name(decoder: PacketDecoder, adult: HumanSkeleton, pepper: Robot) -> None:
    joints = {name: FRAME[3 * i : 3 * i + 3] for i, name in enumerate(adult.feature_joints)}
    got = decoder(packet(frame=..., joints={**joints, "Head": [0, 0, 0]}, confidence={"LElbow": 0.3, "RElbow": 1}))
    assert got.frame is not None
    assert got.frame.tolist() == FRAME
    assert got.tracking == 0.3, "the least counts"
    angles = dict.fromkeys(pepper.joint_names, 0.5)
    robot = PacketDecoder(pepper)(packet(frame=..., joints=angles))
    assert robot.frame is not None
    assert robot.frame.tolist() == [0.5] * 10


@pytest.mark.parametrize(
    ("data", "reason", "message"),
    [
        (b"", "json", "not JSON"),
        (b"\xff\xfe", "json", "not JSON"),
        (b"[1, 2]", "json", "JSON object, got list"),
        (b"[" * 5000, "json", "not JSON"),
        (b'{"v": 1, "seq": ' + b"9" * 5000 + b"}", "json", "not JSON"),
        (b" " * (MAX_BYTES + 1), "oversized", f"up to {MAX_BYTES}"),
        (packet(v=2), "version", "v = 1"),
        (packet(seqq=1), "key", "did you mean 'seq'"),
        (packet(seq=-1), "sequence", "integer"),
        (packet(seq=True), "sequence", "integer"),
        (packet(seq=2**53), "sequence", "integer"),
        (packet(t="now"), "time", "seconds"),
        (packet(t=math.inf), "value", "Infinity is not allowed"),
        (packet(frame=...), "content", "exactly one"),
        (packet(control="stop"), "content", "exactly one"),
        (packet(frame=FRAME[:17]), "shape", "18 numbers, got 17"),
        (packet(frame="x"), "shape", "got str"),
        (packet(frame=[*FRAME[:17], math.nan]), "value", "NaN is not allowed"),
        (packet(frame=[*FRAME[:17], None]), "value", "'RHand.z'"),
        (packet(frame=[*FRAME[:17], True]), "value", "'RHand.z'"),
        (packet(frame=[*FRAME[:17], 1e9]), "value", "'RHand.z'"),
        (packet(frame=[*FRAME[:17], 10**400]), "value", "'RHand.z'"),
        (packet(frame=..., joints=[1]), "joints", "got list"),
        (packet(frame=..., joints={"LSholder": [0, 0, 0]}), "joints", "did you mean 'LShoulder'"),
        (packet(frame=..., joints={"LShoulder": [0, 0, 0]}), "joints", "'LElbow' is missing"),
        (packet(frame=..., joints={"LShoulder": [0, 0]}), "joints", "needs 3 numbers"),
        (packet(frame=..., control="stopp"), "control", "did you mean 'stop'"),
        (packet(confidence=2), "confidence", "from 0 to 1"),
        (packet(confidence={}), "confidence", "from 0 to 1"),
    ],
)
def test_everything_else_is_dropped_with_a_reason(
    decoder: PacketDecoder, data: bytes, reason: str, message: str
) -> None:
    with pytest.raises(PacketError, match=message) as caught:
        decoder(data)
    assert caught.value.reason == reason


def test_the_token_must_match(adult: HumanSkeleton) -> None:
    decoder = PacketDecoder(adult, "a long secret")
    assert decoder(encode_frame(0, 0.0, FRAME, token="a long secret")).sequence == 0
    for wrong in (packet(), packet(token="a long secreT"), packet(token=5), packet(token="\ud800")):
        with pytest.raises(PacketError) as caught:
            decoder(wrong)
        assert caught.value.reason == "token"


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=20) | st.dictionaries(st.text(max_size=8), inner, max_size=6),
    max_leaves=30,
)
NUMBERS = st.lists(st.floats() | st.integers() | st.none(), min_size=17, max_size=19)
ALMOST = st.fixed_dictionaries(
    {},
    optional={
        "v": st.just(1) | JSON,
        "seq": st.integers(0, 2**60) | JSON,
        "t": st.floats() | JSON,
        "token": st.text() | JSON,
        "frame": NUMBERS | JSON,
        "joints": st.dictionaries(st.sampled_from(["LShoulder", "LElbow", "Head", "x"]), NUMBERS) | JSON,
        "confidence": st.floats() | JSON,
        "control": st.sampled_from(["pause", "stop", "halt"]) | JSON,
    },
)
MUTATED = st.builds(
    lambda at, junk: packet()[:at] + junk + packet()[at + len(junk) :], st.integers(0, 400), st.binary(max_size=4)
)
ANYTHING = st.binary(max_size=300) | MUTATED | ALMOST.map(lambda v: json.dumps(v).encode())


FUZZ = os.environ.get("SYDA_GYM_FUZZ")  # number of inputs for a long run; the suite takes a small seeded set


@settings(max_examples=int(FUZZ or 400), deadline=None, derandomize=FUZZ is None)
@given(data=ANYTHING)
def test_whatever_arrives_gives_a_sound_packet_or_a_packet_error(data: bytes) -> None:
    body = catalog.get("adult")
    got, refusal = None, None
    try:
        got = PacketDecoder(body)(data)
    except PacketError as error:
        refusal = error
    if got is None:
        assert refusal is not None
        assert refusal.reason
        assert len(str(refusal)) < 500
        return
    assert (got.frame is None) != (got.control is None)
    assert got.frame is None or (got.frame.shape == (18,) and np.isfinite(got.frame).all())
    assert 0.0 <= got.tracking <= 1.0
    assert math.isfinite(got.sent)


def at(sequence: int, sent: float, control: str | None = None) -> Packet:
    return Packet(sequence, sent, None if control else np.zeros(18), control=control)


def test_only_newer_packets_pass() -> None:
    order = Ordering()
    assert order.admit(at(5, 5.0), 0.0) == ""
    assert order.admit(at(5, 5.0), 0.01) == "duplicate"
    assert order.admit(at(4, 4.9), 0.02) == "reordered"
    assert order.admit(at(9, 5.2), 0.2) == ""
    assert order.lost == 3
    assert order.admit(at(10, 5.1), 0.3) == "reordered", "a clock that goes back"
    assert order.admit(at(11, 5.3), 1.0) == "late", "0.5 s behind the fastest is too old"
    assert order.admit(at(1, 0.0), 1.5) == "", "a sender that begins anew after a silence"


def test_a_huge_number_locks_the_stream_for_a_second_only() -> None:
    order = Ordering()
    order.admit(at(1, 0.0), 0.0)
    assert order.admit(at(2**52, 0.03), 0.03) == ""
    refused = [order.admit(at(2 + i, 0.06 + i / 30), 0.06 + i / 30) for i in range(29)]
    assert set(refused) == {"reordered"}
    assert order.admit(at(40, 1.1), 1.1) == ""


def test_one_sender_drives_at_a_time_but_anybody_may_stop() -> None:
    order = Ordering()
    assert order.admit(at(1, 0.0), 0.0, "a") == ""
    assert order.admit(at(2, 0.1), 0.1, "b") == "stranger"
    assert order.admit(at(0, 0.0, "stop"), 0.2, "b") == ""
    assert order.admit(at(2, 0.2), 0.2, "a") == "", "the stop did not disturb the driver's order"
    assert order.admit(at(7, 9.0), 1.3, "b") == "", "after a silence another one may drive"
