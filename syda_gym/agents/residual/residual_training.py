"""Training of residual policies with Stable-Baselines3: in legs, beside the base alone, resumable bit for bit."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from syda_gym.agents.agent import Agent
from syda_gym.agents.classical.projection import capsule_model
from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.figures import Figures
from syda_gym.agents.learned.policy import ResidualPolicy
from syda_gym.agents.learned.views import mirror_of
from syda_gym.agents.residual.checkpoint import load_checkpoint, restore_model, save_checkpoint
from syda_gym.agents.residual.config import STACK, ResidualConfig
from syda_gym.agents.residual.logs import training_logger
from syda_gym.agents.residual.normalising import spreads
from syda_gym.agents.stacks import build_stack, stack_arrays, stack_spec
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.streams.streams import Streams, score_streams
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.errors import OptionError, StorageError
from syda_gym.locks import locked_folder

if TYPE_CHECKING:
    from collections.abc import Iterator

    from syda_gym.agents.residual.env import ResidualVecEnv

__all__ = ["Leg", "Trained", "train_on_streams", "train_residual"]

Progress = Callable[[float], None]


@dataclass(frozen=True)
class Leg:
    """How a policy stood after a part of the training: steps so far, and figures on the validation streams."""

    steps: int
    policy: Figures
    base: Figures


@dataclass(frozen=True, eq=False)
class Trained:
    """What training gives.

    Attributes:
        agent: the best policy on the validation streams; the untrained one, which is its base, takes part.
        history: one entry per leg, the untrained policy first.
        best: index into ``history``; least by the run's own cost.
        config: hyper-parameters.
        seed: of everything.
    """

    agent: ResidualPolicy
    history: tuple[Leg, ...]
    best: int
    config: ResidualConfig
    seed: int

    @property
    def gained(self) -> bool:
        """Whether the policy is better than its base on the validation streams, by the run's own cost."""
        leg, cost = self.history[self.best], self.config.cost
        return cost.of_figures(leg.policy) < cost.of_figures(leg.base)


def train_residual(
    options: TeleopOptions | Mapping[str, Any] | Ground,
    config: ResidualConfig | None = None,
    *,
    seed: int = 0,
    folder: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    base: Agent | None = None,
) -> Trained:
    """Trains a residual policy on an environment's motions, mapping and disturbances, in the servo model.

    Every fifth action is kept for validation where there are at least two (``Ground.parts``).

    Args:
        options: of the environment, or a ``Ground`` made of them. Keep test motions out with ``clips`` or ``actions``.
        config: hyper-parameters; those of ``ResidualConfig()`` by default.
        seed: of streams, network and exploration; same seed, same weights.
        folder: where checkpoints and logs (TensorBoard, CSV) go; nothing is written if left out.
        resume: go on from the checkpoint in ``folder``.
        progress: called with the share that is done.
        base: the agent below, instead of the rival that the configuration names.

    Raises:
        OptionError: bad options or hyper-parameters.
        StorageError: nothing to resume, or a checkpoint of another training.
        MissingExtraError: TQC without sb3-contrib.
    """
    ground = options if isinstance(options, Ground) else Ground(options)
    settings = config or ResidualConfig()
    if base is None and settings.base == STACK:
        raise OptionError(
            f"this configuration stands on {STACK!r}, whose predictor is trained first; use "
            "syda_gym.agents.training.train_stack, or name a base"
        )
    below = base or make_rival(settings.base, ground.interface, **settings.base_settings)
    train = ground.record_part("train", settings.episodes, seed=2 * seed)
    validation = ground.record_part("validation", settings.validation_episodes, seed=2 * seed + 1)
    return train_on_streams(
        below, train, validation, ground.rates, settings, seed=seed, folder=folder, resume=resume, progress=progress
    )


def train_on_streams(
    base: Agent,
    train: Streams,
    validation: Streams,
    rates: Any,
    config: ResidualConfig,
    *,
    seed: int = 0,
    folder: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Trained:
    """The same on streams that are already recorded; see ``train_residual``."""
    with nullcontext() if folder is None else locked_folder(folder, "training") as place:
        run = _Run(base, train, validation, rates, config, seed, place)
        try:
            with _torch_and_numpy_left_alone():
                if resume:
                    run.resume()
                else:
                    run.begin()
                while not run.finished:
                    run.leg(progress)
            return run.result()
        finally:
            run.close()


class _Run:
    """One training.

    Every leg begins with random numbers and robots that follow from the seed and the leg's number alone. So what
    crosses from leg to leg is the model with its optimiser and the list of results, and a resumed training equals an
    uninterrupted one bit for bit. SAC and TQC also carry a replay buffer, which is not stored: resumed, they fill it
    anew before they learn on.
    """

    def __init__(
        self,
        base: Agent,
        train: Streams,
        validation: Streams,
        rates: Any,
        config: ResidualConfig,
        seed: int,
        folder: Path | None,
    ) -> None:
        import torch

        from syda_gym.agents.residual.env import ResidualVecEnv

        torch.set_num_threads(1)
        self.base, self.validation, self.rates = base, validation, rates
        self.config, self.seed, self.folder = config, seed, folder
        self.env: ResidualVecEnv = ResidualVecEnv(
            _copy(base),
            train,
            rates,
            count=config.robots,
            scale=config.scale,
            smoothing=config.smoothing,
            weights=config.cost,
            each_arm=config.each_arm and mirror_of(base.interface.robot) is not None,
        )
        self.history: list[Leg] = []
        self.snapshots: list[dict[str, NDArray[np.float32]]] = []
        self.model: Any = None

    @property
    def finished(self) -> bool:
        """Whether all legs are done, or patience has run out."""
        done = len(self.history) - 1
        stale = done - self._best()
        return done >= self.config.legs or bool(self.config.patience and stale >= self.config.patience)

    def begin(self) -> None:
        """A new model, and how it stands untrained."""
        self._normalise()
        self.model = self._new_model()
        self._judge()
        self._store()  # so that a training that is stopped in its first leg can be resumed, too

    def resume(self) -> None:
        """The model and the results of a checkpoint."""
        if self.folder is None:
            raise StorageError("resume needs the folder of an earlier training")
        tensors, about = load_checkpoint(self.folder / "checkpoint.safetensors")
        state = about["state"]
        mine = {"config": self.config.as_dict(), "seed": self.seed, "stack": stack_spec(self.base)}
        for key, value in mine.items():
            if state.get(key) != value:
                raise StorageError(
                    f"the checkpoint in {self.folder} is of another training: {key} was {state.get(key)}, is {value}; "
                    "use the same hyper-parameters, seed and base, or another folder"
                )
        self.env.mean, self.env.std = tensors.pop("mean").numpy(), tensors.pop("std").numpy()
        best = {key[5:]: tensors.pop(key).numpy() for key in list(tensors) if key.startswith("best/")}
        self.model = self._new_model(resumed_at=int(about["steps"]))
        restore_model(self.model, tensors, about)
        self.history = [Leg(leg["steps"], Figures(**leg["policy"]), Figures(**leg["base"])) for leg in state["history"]]
        self.snapshots = [{} for _ in self.history]
        self.snapshots[self._best()] = best

    def leg(self, progress: Progress | None) -> None:
        """Trains one leg, judges, stores."""
        from stable_baselines3.common.utils import set_random_seed

        index = len(self.history) - 1
        set_random_seed(_mixed(self.seed, index))
        self.env.seed_all([self.seed, index])
        self.model._last_obs = None
        views = self.env.views.count  # Stable-Baselines3 counts every view of a robot as an environment
        until = views * round(self.config.steps * (index + 1) / self.config.legs)
        self.model.learn(
            max(until - self.model.num_timesteps, 1),
            callback=_callback(progress, self.config.steps * views),
            reset_num_timesteps=False,
            log_interval=None if self.folder is None else 1,
        )
        self._judge()
        self._store()

    def result(self) -> Trained:
        """The best policy so far."""
        best = self._best()
        return Trained(self._agent(self.snapshots[best]), tuple(self.history), best, self.config, self.seed)

    def close(self) -> None:
        """Releases world and log files."""
        self.env.close()
        if self.model is not None and self.folder is not None:
            self.model.logger.close()

    def _normalise(self) -> None:
        """Mean and spread of the features while the base acts alone."""
        self.env.seed_all([self.seed, 0])
        self.env.reset()
        seen = [self.env.raw_features]
        for _ in range(63):
            self.env.step(np.zeros((self.env.num_envs, self.env.views.outputs)))
            seen.append(self.env.raw_features)
        features = np.concatenate(seen)
        self.env.mean, self.env.std = features.mean(axis=0), spreads(features, self.env.interface.n)

    def _new_model(self, resumed_at: int | None = None) -> Any:
        from syda_gym.agents.residual.algorithms import new_model

        model = new_model(self.env, self.config, self.seed, lambda: self.model)
        if self.folder is not None:
            model.set_logger(training_logger(self.folder, resumed_at))
        return model

    def _judge(self) -> None:
        from syda_gym.agents.residual.algorithms import policy_weights

        self.snapshots.append(policy_weights(self.model))
        figures = self._score(self._agent(self.snapshots[-1]))
        base = self.history[0].base if self.history else self._score(self.base)
        self.history.append(Leg(int(self.model.num_timesteps) // self.env.views.count, figures, base))
        if self.folder is not None:
            for name, value in figures.as_dict().items():
                self.model.logger.record(f"validation/policy_{name}", value)
                self.model.logger.record(f"validation/base_{name}", base.as_dict()[name])
            self.model.logger.record("time/total_timesteps", int(self.model.num_timesteps), exclude="tensorboard")
            self.model.logger.dump(int(self.model.num_timesteps))

    def _score(self, agent: Agent) -> Figures:
        capsules = capsule_model(agent.interface.robot) if self.config.cost.contact else None
        return score_streams(agent, self.validation, self.rates, capsules=capsules)

    def _store(self) -> None:
        if self.folder is None:
            return
        import torch

        extras = {"mean": torch.as_tensor(self.env.mean), "std": torch.as_tensor(self.env.std)}
        extras |= {f"best/{k}": torch.as_tensor(v) for k, v in self.snapshots[self._best()].items()}
        state = {
            "config": self.config.as_dict(),
            "seed": self.seed,
            "stack": stack_spec(self.base),
            "history": [
                {"steps": leg.steps, "policy": _plain(leg.policy), "base": _plain(leg.base)} for leg in self.history
            ],
        }
        save_checkpoint(self.model, self.folder / "checkpoint.safetensors", state, extras)

    def _best(self) -> int:
        return int(np.argmin([self.config.cost.of_figures(leg.policy) for leg in self.history]))

    def _agent(self, weights: Mapping[str, NDArray[np.float32]]) -> ResidualPolicy:
        ppo = self.config.algorithm == "ppo"
        return ResidualPolicy(
            self.base.interface,
            self.base,
            weights=weights,
            mean=self.env.mean,
            std=self.env.std,
            scale=self.config.scale,
            smoothing=self.config.smoothing,
            activation="tanh" if ppo else "relu",
            squash="clip" if ppo else "tanh",
            each_arm=self.env.views.each_arm,
        )


def _copy(agent: Agent) -> Agent:
    return build_stack(agent.interface, stack_spec(agent), stack_arrays(agent))


def _mixed(seed: int, leg: int) -> int:
    return int(np.random.SeedSequence([seed, leg]).generate_state(1)[0])


def _plain(figures: Figures) -> dict[str, float]:
    return {key: value for key, value in figures.as_dict().items() if key != "J"}


def _callback(progress: Progress | None, total: int) -> Any:
    from stable_baselines3.common.callbacks import BaseCallback

    class Report(BaseCallback):  # type: ignore[misc]
        def _on_step(self) -> bool:
            if progress is not None:
                progress(min(1.0, self.num_timesteps / total))
            return True

    return Report()


@contextmanager
def _torch_and_numpy_left_alone() -> Iterator[None]:
    """Stable-Baselines3 draws from the global generators; a caller's own random numbers shall not notice."""
    import random

    import torch

    before = random.getstate(), np.random.get_state(), torch.get_rng_state()  # noqa: NPY002
    try:
        yield
    finally:
        random.setstate(before[0])
        np.random.set_state(before[1])  # noqa: NPY002
        torch.set_rng_state(before[2])
