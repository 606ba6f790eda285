"""Drive a simulated Pepper over UDP: a sender plays the person, the loop maps, limits and sends on.

    python examples/live_udp.py [SECONDS]

Replace ``person`` by your camera: any program that sends JSON packets to the port will do.
"""

import socket
import sys
import threading
import time

import numpy as np

import syda_gym
from syda_gym.routes.piloting.choice import choose_mapping
from syda_gym.teleoperation import LoopSettings, TeleoperationLoop, UdpSource, run
from syda_gym.teleoperation.incoming.packets import encode_frame
from syda_gym.teleoperation.outgoing.bullet import BulletSink

seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 8.0
mapping, notices = choose_mapping("adult", "pepper")  # your recordings, else unfitted


def person(port: int, stop: threading.Event) -> None:
    """Stands for a moment, then waves; centimetres on purpose, which the calibration finds out."""
    standing = syda_gym.embodiment("adult").standing()
    wave = syda_gym.load_motions("embedded").clips("adult")[0].frames
    frames = np.concatenate([np.repeat(standing[None], 50, axis=0), wave, wave[::-1]])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        for number, frame in enumerate(frames):
            if stop.wait(1 / 30):
                break
            sock.sendto(encode_frame(number, time.monotonic(), 100.0 * frame), ("127.0.0.1", port))


print(*notices, sep="\n")
loop = TeleoperationLoop(mapping, LoopSettings(calibration=1.0))
stop = threading.Event()
with BulletSink(loop.robot) as robot, UdpSource(mapping.source, port=0) as source:
    sender = threading.Thread(target=person, args=(source.port, stop))
    sender.start()
    stats = run(source, loop, robot, seconds=seconds)
    stop.set()
    sender.join()

for notice in loop.notices:
    print("note:", notice)
figures = stats.summary()
print(f"{figures['frames']} frames, median latency {figures['latency_p50_ms']:.2f} ms, states {figures['states']}")
