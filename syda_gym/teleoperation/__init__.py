"""LIVE use: sources, the loop, sinks."""

from syda_gym.teleoperation.calibration import Calibration, calibrate
from syda_gym.teleoperation.incoming.network import UdpSource, WebSocketSource
from syda_gym.teleoperation.incoming.sources import ReplaySource, Source
from syda_gym.teleoperation.journal import Journal, replay_journal
from syda_gym.teleoperation.live_run import run
from syda_gym.teleoperation.loop import TeleoperationLoop
from syda_gym.teleoperation.outgoing.sinks import ManySinks, MemorySink, Sink, UdpSink
from syda_gym.teleoperation.tick import Decision, LoopSettings, State, Tick

__all__ = [
    "Calibration",
    "Decision",
    "Journal",
    "LoopSettings",
    "ManySinks",
    "MemorySink",
    "ReplaySource",
    "Sink",
    "Source",
    "State",
    "TeleoperationLoop",
    "Tick",
    "UdpSink",
    "UdpSource",
    "WebSocketSource",
    "calibrate",
    "replay_journal",
    "run",
]
