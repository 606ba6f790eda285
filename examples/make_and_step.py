"""Make the environment, drive it with the mapping alone, and read what it tells.

python examples/make_and_step.py
"""

import gymnasium as gym
import numpy as np

import syda_gym  # noqa: F401  (registers the environment)

env = gym.make("SydaTeleop-v0", route="auto", motions="embedded")
observation, info = env.reset(seed=0)
print(f"route {info['route']} (T = {info['transferability']:.3f}), motion {info['motion']}")
for name, part in env.unwrapped.layout.items():
    print(f"  observation[{part.start}:{part.stop}] {name}")

nothing = np.zeros(env.action_space.shape, dtype=np.float32)  # a residual of zero: the base command as it is
rewards, errors = [], []
done = False
while not done:
    observation, reward, terminated, truncated, info = env.step(nothing)
    rewards.append(float(reward))
    errors.append(info["landmark_error"].mean())
    done = terminated or truncated
print(f"{len(rewards)} steps, mean reward {np.mean(rewards):.3f}, mean landmark error {np.mean(errors):.3f} m")
env.close()
