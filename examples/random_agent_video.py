"""Film an agent that acts at random: Gymnasium's rgb_array frames, written by our own film writer.

python examples/random_agent_video.py [FILM.mp4]
"""

import sys

import gymnasium as gym

import syda_gym  # noqa: F401  (registers the environment)
from syda_gym.simulation.pictures.video import write_video

film = sys.argv[1] if len(sys.argv) > 1 else "random_agent.mp4"
env = gym.make("SydaTeleop-v0", render_mode="rgb_array")
env.action_space.seed(0)
env.reset(seed=0)
pictures = []
for _ in range(60):
    _, _, terminated, truncated, _ = env.step(env.action_space.sample())
    pictures.append(env.render())
    if terminated or truncated:
        env.reset()
write_video(film, pictures, fps=env.metadata["render_fps"])
print(f"{film}: {len(pictures)} frames of {pictures[0].shape[1]}x{pictures[0].shape[0]}")
env.close()
