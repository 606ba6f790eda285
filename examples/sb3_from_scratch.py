"""Train a policy with Stable-Baselines3 directly, without our trainer or command line.

    python examples/sb3_from_scratch.py [STEPS]

A short run from scratch only shows that the environment and the library fit together; train_a_residual.py does it well.
"""

import sys

import gymnasium as gym
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy

import syda_gym  # noqa: F401  (registers the environment)

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
env = gym.make("SydaTeleop-v0", physics="servo")  # the fast motor model; physics="bullet" is the default
model = PPO("MlpPolicy", env, n_steps=512, batch_size=128, seed=0, device="cpu")
before = evaluate_policy(model, model.get_env(), n_eval_episodes=3)[0]
model.learn(steps)
after = evaluate_policy(model, model.get_env(), n_eval_episodes=3)[0]
print(f"return over an episode: {before:.1f} before, {after:.1f} after {steps} steps")
env.close()
