"""Train with Ray RLlib, which pins a Gymnasium of its own (1.2) and so wants a virtual environment of its own.

python3.11 -m venv rllib-venv
rllib-venv/bin/pip install . "ray[rllib]" torch
rllib-venv/bin/python examples/rllib_from_scratch.py [ITERATIONS]
"""

import sys

import gymnasium as gym
from ray.rllib.algorithms.ppo import PPOConfig
from ray.tune.registry import register_env


def make(config: dict) -> gym.Env:
    """Makes the environment in a worker process, which has to import the package to know the id."""
    import syda_gym  # noqa: F401

    return gym.make("SydaTeleop-v0", physics="servo", **config)


register_env("SydaTeleop-v0", make)
config = (
    PPOConfig()
    .environment("SydaTeleop-v0", env_config={"mapping": "nearest"})
    .env_runners(num_env_runners=0)
    .training(train_batch_size_per_learner=1024, minibatch_size=256, num_epochs=2)
    .debugging(seed=0)
)
algorithm = config.build_algo()
for iteration in range(int(sys.argv[1]) if len(sys.argv) > 1 else 3):
    result = algorithm.train()
    print(f"iteration {iteration}: mean return {result['env_runners']['episode_return_mean']:.1f}")
algorithm.stop()
