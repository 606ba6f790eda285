"""A film of a person becomes a film of Pepper doing the same.

    python examples/02_your_film.py [ME.mp4]

Needs `pip install 'syda-gym[camera]'` and the pose model (see docs/live.md). Without a film a shipped, synthetic motion
is taken, and this says so.
"""

import sys

import numpy as np

import syda_gym
from syda_gym.simulation.pictures.camera import Camera, CameraView
from syda_gym.simulation.pictures.video import write_video

if len(sys.argv) > 1:
    motions = syda_gym.load_motions(f"film:{sys.argv[1]}", fps=30)
    print(*motions.notes, sep="\n")
    clip = next(iter(motions.clips("operator")))
else:
    print("no film was named, so a shipped motion is taken")
    clip = next(clip for clip in syda_gym.load_motions("embedded").clips("adult") if clip.action == "wave_high")

mapping = syda_gym.unfitted(clip.body, "pepper")  # no recordings: the robot's limbs point as the person's
commands = mapping.sequence(clip.frames, clip.fps)  # in time order, within the joints' limits and speeds
with Camera(mapping.target, clip.body, CameraView(error=False, ghost=False)) as camera:
    pictures = [camera.picture(q, operator=frame) for q, frame in zip(commands, clip.frames, strict=True)]
write_video("your_film.mp4", pictures, fps=clip.fps)

person = np.diff(clip.body.arm_points(clip.frames), axis=2)
robot = np.diff(mapping.target.arm_points(commands), axis=2)
cosine = np.sum(person * robot, axis=-1) / (np.linalg.norm(person, axis=-1) * np.linalg.norm(robot, axis=-1))
print(f"{clip.action}: limbs within {np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean():.1f} degrees of the person's")
print("film: your_film.mp4")
