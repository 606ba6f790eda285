"""Add a robot from its URDF and move it at once, without recordings: the limbs point as the person's do.

    python examples/new_robot.py [URDF]

The description and a picture go to $SYDA_GYM_HOME/robots (by default ~/.syda_gym/robots). Without an argument NAO's
URDF plays the unknown robot.
"""

import sys

import numpy as np

import syda_gym
from syda_gym.files import asset
from syda_gym.routes.piloting.choice import choose_mapping
from syda_gym.routes.suggestion import suggest
from syda_gym.teleoperation.setup.robot_setup import add_robot

urdf = sys.argv[1] if len(sys.argv) > 1 else asset("robots", "nao.urdf")
added = add_robot(urdf, "newcomer", replace_existing=True)
robot = added.robot
print(f"{robot!r}")
print(f"description {added.description.name}, picture {added.picture.name}")
for notice in added.notices:
    print("check:", notice)

mapping, notices = choose_mapping("adult", "newcomer")
print(*notices, sep="\n")
clip = syda_gym.load_motions("embedded").clips("adult")[0]
commands = mapping.sequence(clip.frames, clip.fps)
person = np.diff(clip.body.arm_points(clip.frames), axis=2)
moved = np.diff(robot.arm_points(commands), axis=2)
cosine = np.sum(person * moved, axis=-1) / (np.linalg.norm(person, axis=-1) * np.linalg.norm(moved, axis=-1))
print(f"{clip.action}: limbs within {np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean():.1f} degrees of the person's")

best = suggest(["adult", "kid", "pepper", "newcomer"], [("adult", "pepper"), ("kid", "pepper")])[0]
print(f"record next: {' and '.join(best.pair)}")
