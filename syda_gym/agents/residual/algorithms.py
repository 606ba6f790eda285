"""Algorithms: PPO, SAC and TQC set up so that their untrained policy corrects nothing, and read out as plain arrays."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.errors import MissingExtraError

__all__ = ["new_model", "policy_weights"]


def new_model(env: Any, config: ResidualConfig, seed: int, current: Callable[[], Any]) -> Any:
    """A Stable-Baselines3 model with a zero-initialised last layer.

    Args:
        env: a ``ResidualVecEnv``.
        config: hyper-parameters.
        seed: of the network.
        current: gives the model that is being trained, whose steps set the learning rate.

    Raises:
        MissingExtraError: TQC without sb3-contrib.
    """

    def learning_rate(_: float) -> float:
        # Stable-Baselines3 counts progress within one call of ``learn``; a training here has several.
        model = current()
        done = 0.0 if model is None else model.num_timesteps / (config.steps * env.views.count)
        return config.learning_rate * max(0.0, 1.0 - done)

    if config.algorithm == "ppo":
        return _ppo(env, config, seed, learning_rate)
    return _off_policy(env, config, seed, learning_rate)


def policy_weights(model: Any) -> dict[str, NDArray[np.float32]]:
    """The deterministic policy as ``layers.i.weight`` and ``layers.i.bias``."""
    policy = model.policy
    if hasattr(policy, "action_net"):
        body, head = policy.mlp_extractor.policy_net, policy.action_net
    else:
        body, head = policy.actor.latent_pi, policy.actor.mu
    linear = [layer for layer in body if hasattr(layer, "weight")] + [head]
    weights: dict[str, NDArray[np.float32]] = {}
    for index, layer in enumerate(linear):
        weights[f"layers.{index}.weight"] = layer.weight.detach().numpy().copy()
        weights[f"layers.{index}.bias"] = layer.bias.detach().numpy().copy()
    return weights


def _ppo(env: Any, config: ResidualConfig, seed: int, learning_rate: Callable[[float], float]) -> Any:
    import torch
    from stable_baselines3 import PPO

    model = PPO(
        "MlpPolicy",
        env,
        learning_rate=learning_rate,
        n_steps=config.rollout,
        batch_size=min(config.batch, env.num_envs * config.rollout),
        n_epochs=config.epochs,
        gamma=config.gamma,
        gae_lambda=config.gae_lambda,
        clip_range=config.clip_range,
        ent_coef=config.entropy,
        policy_kwargs={
            "net_arch": list(config.hidden),
            "activation_fn": torch.nn.Tanh,
            "log_std_init": config.log_std,
        },
        seed=seed,
        device="cpu",
    )
    _zero(model.policy.action_net)
    return model


def _off_policy(env: Any, config: ResidualConfig, seed: int, learning_rate: Callable[[float], float]) -> Any:
    kind = _off_policy_class(config.algorithm)
    model = kind(
        "MlpPolicy",
        env,
        learning_rate=learning_rate,
        buffer_size=config.buffer,
        learning_starts=config.learning_starts,
        batch_size=config.batch,
        gamma=config.gamma,
        train_freq=1,
        gradient_steps=config.epochs,
        policy_kwargs={"net_arch": list(config.hidden), "log_std_init": config.log_std},
        seed=seed,
        device="cpu",
    )
    _zero(model.policy.actor.mu)
    return model


def _off_policy_class(algorithm: str) -> Any:
    if algorithm == "sac":
        from stable_baselines3 import SAC

        return SAC
    try:
        from sb3_contrib import TQC
    except ImportError as error:
        raise MissingExtraError("the algorithm TQC", "train") from error
    return TQC


def _zero(layer: Any) -> None:
    import torch

    with torch.no_grad():
        layer.weight.zero_()
        layer.bias.zero_()
