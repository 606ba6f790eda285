"""Train a policy with plain Stable-Baselines3 PPO, without our trainer, and judge it on actions that it has not seen.

    python examples/08_sb3_from_scratch.py [STEPS]

The hyper-parameters work (a gamma of 0.99 does not): a million steps take minutes; a short run shows the way only.
J is landmark error [mm] + 0.05 x joint error [mrad] + jitter; the base is the mapping's command, an action of zero.
"""

import sys

import gymnasium as gym
import numpy as np
from stable_baselines3 import PPO

import syda_gym
from syda_gym.agents.figures import episode_figures, mean_figures
from syda_gym.envs.sb3 import TeleopVecEnv
from syda_gym.envs.vector import SydaTeleopVectorEnv

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
actions = sorted(syda_gym.load_motions("embedded").families)
seen, unseen = actions[5:], actions[:5]
# The fast motor model; what the mapping asks for is the goal; three commands ahead are seen; trembling is dear.
world = {"physics": "servo", "reference": "mapped", "preview": 3}

train = SydaTeleopVectorEnv(
    32, autoreset_mode="same_step", actions=seen, start="uniform", reward={"jitter": 5.0}, **world
)
model = PPO(
    "MlpPolicy",
    TeleopVecEnv(train),
    n_steps=64,
    batch_size=512,
    n_epochs=8,
    gamma=0.5,
    gae_lambda=0.9,
    learning_rate=1e-3,
    policy_kwargs={"log_std_init": -2.0, "net_arch": [64, 64]},
    seed=0,
    device="cpu",
)
model.learn(steps)

env = gym.make("SydaTeleop-v0", actions=unseen, **world)
for name in ("base", "policy"):
    found = []
    for clip in range(len(env.unwrapped.clip_names)):
        observation, info = env.reset(seed=0, options={"motion": clip})
        rows, done = [], False
        while not done:
            action = np.zeros(10, np.float32) if name == "base" else model.predict(observation, deterministic=True)[0]
            observation, _, terminated, truncated, info = env.step(action)
            rows.append((info["q"], info["reference"]))
            done = terminated or truncated
        q, reference = (np.array(column) for column in zip(*rows, strict=True))
        found.append(episode_figures(env.unwrapped.robot, q, reference))
    print(f"{name:>6} after {steps} steps, unseen actions: J {mean_figures(found).objective:.2f}")
env.close()
