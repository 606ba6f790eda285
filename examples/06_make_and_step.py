"""Make the environment, drive it with the mapping alone, read what it tells, and film it.

python examples/06_make_and_step.py [FILM.mp4]
"""

import sys

import gymnasium as gym
import numpy as np

import syda_gym  # noqa: F401  (registers the environment)
from syda_gym.simulation.pictures.video import write_video

film = sys.argv[1] if len(sys.argv) > 1 else "make_and_step.mp4"
env = gym.make("SydaTeleop-v0", render_mode="rgb_array", actions=["wave_high"])
observation, info = env.reset(seed=0)
print(f"route {info['route']} (T = {info['transferability']:.3f}), motion {info['motion']}")
for name, part in env.unwrapped.layout.items():
    print(f"  observation[{part.start}:{part.stop}] {name}")

nothing = np.zeros(env.action_space.shape, dtype=np.float32)  # a residual of zero: the base command as it is
rewards, errors, pictures = [], [], []
done = False
while not done:
    observation, reward, terminated, truncated, info = env.step(nothing)
    rewards.append(float(reward))
    errors.append(info["landmark_error"].mean())
    pictures.append(env.render())
    done = terminated or truncated
print(f"{len(rewards)} steps, mean reward {np.mean(rewards):.3f}, mean landmark error {np.mean(errors):.3f} m")
write_video(film, pictures, fps=env.metadata["render_fps"])
print(f"film: {film}")
env.close()
