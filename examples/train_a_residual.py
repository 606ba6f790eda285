"""Train a residual policy on top of the mapping, and judge it beside its base on actions that it has not seen.

    python examples/train_a_residual.py [STEPS]

The link is noisy and the motors lag. The policy learns in the fast motor model and is judged in Bullet. A short
run shows the way, not what can be reached: syda-gym train and the page on agents do it in earnest.
"""

import sys

import syda_gym
from syda_gym.agents.bundle import save_agent
from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.residual.residual_training import train_residual
from syda_gym.agents.rollout import evaluate, mean_of

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 60_000
actions = sorted(syda_gym.load_motions("embedded").families)
seen, unseen = actions[4:], actions[:4]

world = {"disturbances": "teleop:noise:test", "reference": "mapped"}
config = ResidualConfig.preset("short", steps=steps)
trained = train_residual({**world, "actions": seen, "physics": "servo"}, config, seed=0)
for leg in trained.history:
    print(f"{leg.steps:>7} steps, validation: base {leg.base.objective:.1f}, policy {leg.policy.objective:.1f}")

agents = {"base": trained.agent.base, "residual": trained.agent}
results = evaluate({**world, "actions": unseen}, agents, seed=0)
for name, episodes in results.items():
    figures = mean_of(episodes)
    print(
        f"{name:>9} on unseen actions, in Bullet: {figures.landmark_mm:.1f} mm, jitter {figures.jitter:.2f} mm/frame^3"
    )
save_agent(trained.agent, "residual")  # residual.safetensors and its card residual.json
