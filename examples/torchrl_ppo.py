"""PPO by TorchRL, on its own GymEnv around an id of the family.

pip install torchrl            # tried with 0.14.1
python examples/torchrl_ppo.py [STEPS]
"""

import sys

import torch
from tensordict.nn import TensorDictModule
from tensordict.nn.distributions import NormalParamExtractor
from torch import nn
from torchrl.envs import GymEnv
from torchrl.modules import IndependentNormal, ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

import syda_gym  # noqa: F401 (registers the ids)

steps, frames = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000, 2048
torch.manual_seed(0)
env = GymEnv("SydaTeleopNoise-v0", physics="servo", device="cpu")
env.set_seed(0)
size, joints = env.observation_spec["observation"].shape[-1], env.action_spec.shape[-1]
head = nn.Linear(64, 2 * joints)
nn.init.orthogonal_(head.weight, 0.01)  # the untrained policy corrects next to nothing
body = nn.Sequential(
    nn.Linear(size, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), head, NormalParamExtractor("biased_softplus_0.15")
)
policy = ProbabilisticActor(
    TensorDictModule(body, in_keys=["observation"], out_keys=["loc", "scale"]),
    spec=env.action_spec,
    in_keys=["loc", "scale"],
    distribution_class=IndependentNormal,
    return_log_prob=True,
)
value = ValueOperator(nn.Sequential(nn.Linear(size, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 1)))
advantage = GAE(gamma=0.5, lmbda=0.9, value_network=value, average_gae=True)
loss = ClipPPOLoss(policy, value, clip_epsilon=0.2, entropy_bonus=False)
optimizer = torch.optim.Adam(loss.parameters(), lr=1e-3)
for _ in range(max(1, steps // frames)):
    with torch.no_grad():
        batch = env.rollout(frames, policy, break_when_any_done=False)
        advantage(batch)
    for _ in range(8):
        for rows in torch.randperm(len(batch)).split(512):
            told = loss(batch[rows])
            total = told["loss_objective"] + told["loss_critic"]
            optimizer.zero_grad()
            total.backward()
            optimizer.step()
    print(f"mean reward of a step {batch['next', 'reward'].mean().item():.3f}", flush=True)
print(f"trained on {max(1, steps // frames) * frames} steps")
env.close()
