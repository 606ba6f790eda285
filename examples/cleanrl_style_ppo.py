"""PPO in one file, in the manner of CleanRL, on the vectorised environment; PyTorch is all that it needs.

    python examples/cleanrl_style_ppo.py [STEPS]

CleanRL's own ppo_continuous_action.py (1.2.0, Gymnasium 0.29) takes every id of the family unmodified, too.
"""

import sys

import gymnasium as gym
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal

import syda_gym  # noqa: F401 (registers the ids)

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 200_000
robots, horizon, gamma, smoothing, clip = 64, 32, 0.5, 0.9, 0.2
torch.manual_seed(0)
envs = gym.make_vec("SydaTeleopNoise-v0", num_envs=robots, physics="servo", autoreset_mode="same_step")
size, joints = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
actor, critic = (
    nn.Sequential(nn.Linear(size, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, outputs))
    for outputs in (joints, 1)
)
nn.init.orthogonal_(actor[-1].weight, 0.01)  # the untrained policy corrects next to nothing
log_std = nn.Parameter(torch.full((joints,), -2.0))
optimizer = torch.optim.Adam([*actor.parameters(), *critic.parameters(), log_std], lr=1e-3, eps=1e-5)
observation, returns, ended = torch.as_tensor(envs.reset(seed=0)[0]), np.zeros(robots), []
for _ in range(max(1, steps // (robots * horizon))):
    rows = []
    for _ in range(horizon):
        with torch.no_grad():
            policy = Normal(actor(observation), log_std.exp())
            action, value = policy.sample(), critic(observation)[:, 0]
        after, reward, terminated, truncated, _ = envs.step(action.numpy())
        done, returns = terminated | truncated, returns + reward
        ended, returns = ended + returns[done].tolist(), np.where(done, 0.0, returns)
        told = torch.as_tensor(np.stack([reward, ~done]), dtype=torch.float32)
        rows.append((observation, action, policy.log_prob(action).sum(1), value, *told))
        observation = torch.as_tensor(after)
    seen, actions, before, values, rewards, goes_on = (torch.stack(column) for column in zip(*rows, strict=True))
    following = torch.cat([values[1:], critic(observation).detach()[None, :, 0]])
    advantages, last = torch.zeros_like(rewards), 0.0
    for t in reversed(range(horizon)):
        last = rewards[t] - values[t] + goes_on[t] * gamma * (following[t] + smoothing * last)
        advantages[t] = last
    flat = [column.flatten(0, 1) for column in (seen, actions, before, advantages, advantages + values)]
    for batch in (part for _ in range(8) for part in torch.randperm(robots * horizon).split(512)):
        seen, actions, before, gains, goals = (column[batch] for column in flat)
        ratio = (Normal(actor(seen), log_std.exp()).log_prob(actions).sum(1) - before).exp()
        gains = (gains - gains.mean()) / (gains.std() + 1e-8)
        surrogate = torch.min(gains * ratio, gains * ratio.clamp(1 - clip, 1 + clip)).mean()
        loss = 0.5 * (critic(seen)[:, 0] - goals).square().mean() - surrogate
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
print(f"return at the beginning {np.mean(ended[:64]):.1f}, at the end {np.mean(ended[-64:]):.1f}")
envs.close()
