"""Add a robot from its URDF and move it at once, without recordings: the limbs point as the person's do.

    python examples/03_your_robot.py [URDF]

The description and a picture go to $SYDA_GYM_HOME/robots (by default ~/.syda_gym/robots). Without an argument NAO's
URDF plays the unknown robot.
"""

import sys

import syda_gym
from syda_gym.files import asset
from syda_gym.routes.piloting.choice import choose_mapping
from syda_gym.simulation.pictures.camera import Camera, CameraView
from syda_gym.simulation.pictures.video import write_video
from syda_gym.teleoperation.setup.robot_setup import add_robot

urdf = sys.argv[1] if len(sys.argv) > 1 else asset("robots", "nao.urdf")
added = add_robot(urdf, "newcomer", replace_existing=True)
robot, verdict = added.robot, added.verdict
print(f"{robot!r}")
print(f"{verdict.word}: can point its limbs within {57.3 * verdict.error:.1f} degrees of a person's {verdict.reason}")
print(f"description {added.description}\npicture {added.picture}")
for notice in added.notices:
    print("check:", notice)

mapping, notices = choose_mapping("adult", "newcomer")
print(*notices, sep="\n")
clip = next(clip for clip in syda_gym.load_motions("embedded").clips("adult") if clip.action == "wave_high")
commands = mapping.sequence(clip.frames, clip.fps)
with Camera(robot, clip.body, CameraView(error=False, ghost=False)) as camera:
    pictures = [camera.picture(q, operator=frame) for q, frame in zip(commands, clip.frames, strict=True)]
write_video("your_robot.mp4", pictures, fps=clip.fps)
print("film: your_robot.mp4")
