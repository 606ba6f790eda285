"""You in front of the camera, a simulated Pepper follows; what it did becomes a film.

    python examples/01_camera_to_pepper.py [SECONDS]

Stand still with hanging arms for two seconds, then move. Needs `pip install 'syda-gym[camera]'` and the pose model (see
docs/live.md); without a camera a recording drives, and this says so. Nothing was fitted to you: Pepper's limbs point as
yours. On a page in the browser, with an emergency stop: `syda-gym teleop --source camera --view`.
"""

import sys

from syda_gym.errors import SydaError
from syda_gym.motions.film.pictures import CameraPictures
from syda_gym.motions.film.pose_model import find_model
from syda_gym.routes.piloting.choice import choose_mapping
from syda_gym.teleoperation.session import teleoperate

seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
try:
    find_model()
    CameraPictures(0).close()
    source = "camera"
except SydaError as error:
    print(f"no camera, so a recording drives: {error}")
    source = "replay:embedded"

mapping, notices = choose_mapping("adult", "pepper")  # what you recorded of the pair, else unfitted
print(*notices, sep="\n")
statistics = teleoperate(
    mapping,
    source,
    ["video:camera_to_pepper.mp4"],
    actions=() if source == "camera" else ["wave_high"],
    seconds=seconds,
)
figures = statistics.summary()
print(f"{figures['frames']} frames, median latency {figures['latency_p50_ms']:.1f} ms, states {figures['states']}")
print("film: camera_to_pepper.mp4")
