"""Train a predictor and a residual policy on it, and judge them beside the others on actions that they have not seen.

    python examples/07_train_a_residual.py [STEPS]

The link is noisy and the motors lag. All learn in the fast motor model and are judged in Bullet. A short run shows the
way, not what can be reached: syda-gym train and the page on agents do it in earnest.
"""

import sys

import syda_gym
from syda_gym.agents.bundle import save_agent
from syda_gym.agents.predictor.predictor_training import PredictorConfig
from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.rollout import evaluate, mean_of
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.training import train_stack

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 60_000
actions = sorted(syda_gym.load_motions("embedded").families)
seen, unseen = actions[4:], actions[:4]

world = {"disturbances": "teleop:noise:test", "reference": "mapped"}
config = ResidualConfig.preset("teleop", steps=steps, legs=3, episodes=96, validation_episodes=24)
ground = Ground({**world, "actions": seen, "physics": "servo"})
found = train_stack(ground, config, predictor=PredictorConfig(iterations=min(100, 10 + steps // 150)), seed=0)
for leg in found.trained.history:
    print(f"{leg.steps:>7} steps, validation: below {leg.base.objective:.2f}, policy {leg.policy.objective:.2f}")

results = evaluate({**world, "actions": unseen}, found.agents, seed=0)
for name, episodes in results.items():
    figures = mean_of(episodes)
    print(
        f"{name:>9} on unseen actions, in Bullet: J {figures.objective:.1f}, "
        f"{figures.landmark_mm:.1f} mm, jitter {figures.jitter:.2f} mm/frame^3"
    )
save_agent(found.trained.agent, "residual")  # residual.safetensors and its card residual.json
