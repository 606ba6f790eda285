"""Episodes as a Minari data set, for offline reinforcement learning (https://minari.farama.org)."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.errors import MissingExtraError, OptionError, StorageError
from syda_gym.evaluation.benchmark.config import split_method

__all__ = ["Exported", "export_minari"]


@dataclass(frozen=True)
class Exported:
    """What was stored: number of episodes and steps, and the folder."""

    episodes: int
    steps: int
    path: Path


def export_minari(
    name: str,
    *,
    motions: str = "embedded",
    route: str = "adult>pepper",
    method: str = "syda",
    agent: str = "base",
    disturbance: str = "none",
    episodes: int = 0,
    seed: int = 0,
    command: str = "",
    **options: Any,
) -> Exported:
    """Plays episodes and stores observations, actions and rewards.

    The environment is described by plain options, so that ``minari.load_dataset(name).recover_environment()`` makes it
    again. Actions are corrections of the base command in [-1, 1]; for the agent ``base`` they are zero but for
    the rounding of the observation that it reads its command from.

    Args:
        name: such as ``syda/adult-pepper-v0``; Minari wants a version at the end.
        motions: what ``load_motions`` takes.
        route: chain, written ``adult>kid>pepper``.
        method: mapping method, with a preset behind a colon.
        agent: ``base`` or a classical rival.
        disturbance: ``none`` or a preset.
        episodes: how many; 0 for one a clip.
        seed: of the episodes.
        command: the command line, for the data set's description.
        **options: further options of ``SydaTeleop-v0``.

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
    bodies = tuple(part.strip() for part in route.split(">"))
    kind, preset = split_method(method)
    settings = {
        "operator": bodies[0],
        "robot": bodies[-1],
        "route": bodies,
        "mapping": kind,
        "preset": preset,
        "motions": motions,
        "disturbances": None if disturbance == "none" else disturbance,
        **options,
    }
    env = minari.DataCollector(gymnasium.make(ENV_ID, **settings))
    try:
        inner: Any = env.unwrapped
        actor = make_rival(agent, Interface.of(inner))
        clips = len(inner.clip_names)
        count = episodes or clips
        steps = sum(_play(env, inner, actor, index % clips, seed, index) for index in range(count))
        env.create_dataset(
            dataset_id=name,
            algorithm_name=f"{method}, agent {agent}",
            description=f"{route} on {motions}, disturbance {disturbance}, seed {seed}. {command}".strip(),
            requirements=[f"syda-gym; python_version=='{platform.python_version()}'"],
        )
    finally:
        env.close()
    return Exported(count, steps, Path(str(minari.load_dataset(name).storage.data_path)).parent)


def _play(env: Any, inner: Any, actor: Any, clip: int, seed: int, index: int) -> int:
    episode_seed = int(np.random.SeedSequence([seed, index]).generate_state(1)[0])
    observation, _ = env.reset(seed=episode_seed, options={"motion": clip})
    actor.reset(1, episode_seed)
    steps, done = 0, False
    while not done:
        action = inner.action_from_command(actor.act(observation[None])[0])
        observation, _, terminated, truncated, _ = env.step(np.asarray(action, dtype=np.float32))
        steps, done = steps + 1, terminated or truncated
    return steps
