"""Episodes as a Minari data set, for offline reinforcement learning (https://minari.farama.org)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.errors import MissingExtraError, OptionError, StorageError
from syda_gym.evaluation.data_sets.scene import Exported, Scene, episode_seeds

__all__ = ["export_minari"]


def export_minari(name: str, scene: Scene, *, episodes: int = 0) -> Exported:
    """Plays episodes and stores observations, actions and rewards.

    The environment is described by plain options, so that ``minari.load_dataset(name).recover_environment()`` makes it
    again. Actions are corrections of the base command in [-1, 1]; for the agent ``base`` they are zero but for
    the rounding of the observation that it reads its command from.

    Args:
        name: such as ``syda/adult-pepper-v0``; Minari wants a version at the end.
        scene: what is played.
        episodes: how many; 0 for one a clip.

    Raises:
        MissingExtraError: Minari is not installed.
        OptionError: a name that Minari does not take, or options that the environment does not take.
        StorageError: a data set of that name exists, or it cannot be written.
    """
    try:
        import jax  # noqa: F401  (Minari's recorder needs it)
        import minari
        from minari.dataset.minari_dataset import parse_dataset_id
    except ImportError as error:
        raise MissingExtraError("exporting episodes for Minari", "data") from error
    import gymnasium

    from syda_gym import ENV_ID
    from syda_gym.agents.classical.rivals import make_rival
    from syda_gym.agents.interface import Interface

    try:
        parse_dataset_id(name)
    except ValueError as error:
        raise OptionError(f"{name!r} is no name of a Minari data set: {error}; try syda/adult-pepper-v0") from error
    if name in minari.list_local_datasets():
        raise StorageError(f"a data set {name!r} exists; raise its version, or delete it with `minari delete {name}`")
    env = minari.DataCollector(gymnasium.make(ENV_ID, **scene.environment()))
    try:
        inner: Any = env.unwrapped
        actor = make_rival(scene.agent, Interface.of(inner))
        steps = [
            _play(env, inner, actor, clip, seed)
            for clip, seed in episode_seeds(scene.seed, len(inner.clip_names), episodes)
        ]
        env.create_dataset(
            dataset_id=name,
            algorithm_name=f"{scene.method}, agent {scene.agent}",
            description=scene.words(),
            requirements=scene.requirements(),
        )
    finally:
        env.close()
    return Exported(len(steps), sum(steps), Path(str(minari.load_dataset(name).storage.data_path)).parent)


def _play(env: Any, inner: Any, actor: Any, clip: int, seed: int) -> int:
    observation, _ = env.reset(seed=seed, options={"motion": clip})
    actor.reset(1, seed)
    steps, done = 0, False
    while not done:
        action = inner.action_from_command(actor.act(observation[None])[0])
        observation, _, terminated, truncated, _ = env.step(np.asarray(action, dtype=np.float32))
        steps, done = steps + 1, terminated or truncated
    return steps
