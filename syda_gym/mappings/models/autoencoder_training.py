"""Training: many dual autoencoders at once, as one batched network (``torch.baddbmm``)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError
from syda_gym.mappings.models.batched import Batch, BatchedNetwork
from syda_gym.mappings.models.networks import Stack
from syda_gym.mappings.models.settings import TrainingSettings

if TYPE_CHECKING:
    import torch

__all__ = ["Job", "Progress", "TrainingSettings", "train"]

_WORK = 20_000_000
"""Multiplications in one pass forward of a group of models. With fewer, calls cost more than arithmetic; with more,
the group outgrows the processor's cache."""

Progress = Callable[[float], None]
"""Called with the finished fraction, 0 to 1."""


@dataclass(frozen=True)
class Job:
    """One model to train: codes of A and B row by row, and a seed.

    Attributes:
        a: ``(N, D_A)``.
        b: ``(N, D_B)``.
        seed: of the weights, the order of rows and the noise.
    """

    a: FloatArray
    b: FloatArray
    seed: int


def train(jobs: Sequence[Job], settings: TrainingSettings, progress: Progress | None = None) -> list[dict[str, Stack]]:
    """Trains one model per job, all together.

    Models do not influence each other: each has its own rows, order, noise and optimiser state. The same jobs with
    the same settings give the same bits.

    Args:
        jobs: at least one; all with equal code widths, row counts may differ.
        settings: sizes, losses and optimiser.
        progress: told the finished fraction.

    Returns:
        Per job the stacks by name: ``encode_a``, ``decode_a``, ``encode_b``, ``decode_b``.

    Raises:
        OptionError: no job, or widths differ.
    """
    import torch

    widths = {(job.a.shape[1], job.b.shape[1]) for job in jobs}
    if len(widths) != 1:
        raise OptionError(f"jobs trained together need equal widths, got {sorted(widths)}")
    groups = _groups(jobs, settings, widths.pop())
    result: dict[int, dict[str, Stack]] = {}
    with torch.no_grad():
        for group in groups:
            part = [jobs[index] for index in group]
            network = BatchedNetwork(settings, part[0].a.shape[1], part[0].b.shape[1], [job.seed for job in part])
            feed = _Feed(part, settings)
            for epoch in range(feed.epochs):
                for batch in feed.epoch():
                    network.step(batch)
                if progress is not None:
                    progress((len(result) + len(group) * (epoch + 1) / feed.epochs) / len(jobs))
            result.update(zip(group, network.stacks(), strict=True))
    return [result[index] for index in range(len(jobs))]


def _groups(jobs: Sequence[Job], settings: TrainingSettings, widths: tuple[int, int]) -> list[list[int]]:
    """Jobs that train together; those with equally many rows side by side, because they need no masks."""
    weights = sum(
        a * b for stack in settings.stacks(*widths).values() for a, b in zip(stack[:-1], stack[1:], strict=True)
    )
    most = max(1, _WORK // (settings.batch * weights))
    counts = Counter(len(job.a) for job in jobs)
    order = sorted(range(len(jobs)), key=lambda index: len(jobs[index].a))
    groups: list[list[int]] = [[]]
    for place, index in enumerate(order):
        count = len(jobs[index].a)
        first_of_its_kind = place == 0 or len(jobs[order[place - 1]].a) != count
        if len(groups[-1]) >= most or (first_of_its_kind and len(groups[-1]) + counts[count] > most):
            groups.append([])
        groups[-1].append(index)
    return [group for group in groups if group]


class _Feed:
    """Hands out the rows of every model, shuffled and with noise, epoch by epoch."""

    def __init__(self, jobs: Sequence[Job], settings: TrainingSettings) -> None:
        import torch

        self.settings = settings
        self.counts = np.array([len(job.a) for job in jobs])
        self.a, self.b = _padded([job.a for job in jobs]), _padded([job.b for job in jobs])
        self.orders = [np.random.default_rng([job.seed, 1]) for job in jobs]
        self.noises = [torch.Generator().manual_seed(int(job.seed) * 2 + 1) for job in jobs]
        self.steps = np.ceil(self.counts / settings.batch).astype(int)
        self.epochs = settings.epochs
        self.done = 0

    def epoch(self) -> Iterator[Batch]:
        """The batches of one epoch; models with fewer rows sit the last ones out."""
        import torch

        longest = int(self.counts.max())
        rows = np.zeros((len(self.counts), longest), dtype=np.int64)
        for model, (count, order) in enumerate(zip(self.counts, self.orders, strict=True)):
            rows[model, :count] = order.permutation(count)
        index = torch.from_numpy(rows)[:, :, None]
        a = torch.gather(self.a, 1, index.expand(-1, -1, self.a.shape[2]))
        b = torch.gather(self.b, 1, index.expand(-1, -1, self.b.shape[2]))
        seen_a, seen_b = self._noisy(a, b)
        even = bool((self.counts == longest).all())
        shortest = int(self.counts.min())
        for step, start in enumerate(range(0, longest, self.settings.batch)):
            part = slice(start, min(start + self.settings.batch, longest))
            weight, active = (None, None) if part.stop <= shortest else self._weights(part)
            rate = self._rate(step, even)
            yield Batch(a[:, part], b[:, part], seen_a[:, part], seen_b[:, part], weight, active, rate)
        self.done += 1

    def _noisy(self, a: torch.Tensor, b: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        import torch

        if self.settings.noise == 0.0:
            return a, b
        noise = torch.zeros((*a.shape[:2], a.shape[2] + b.shape[2]))
        for model, (count, generator) in enumerate(zip(self.counts.tolist(), self.noises, strict=True)):
            noise[model, :count].normal_(0.0, self.settings.noise, generator=generator)
        return a + noise[:, :, : a.shape[2]], b + noise[:, :, a.shape[2] :]

    def _weights(self, part: slice) -> tuple[torch.Tensor, torch.Tensor | None]:
        """Weight of each row (0 for padding), and which models take part at all (``None`` if all do)."""
        import torch

        valid = np.arange(part.start, part.stop)[None] < self.counts[:, None]
        active = valid.any(axis=1)
        weight = valid / np.maximum(valid.sum(axis=1, keepdims=True), 1)
        return (
            torch.from_numpy(weight.astype(np.float32)),
            None if active.all() else torch.from_numpy(active)[:, None],
        )

    def _rate(self, step: int, even: bool) -> torch.Tensor | float:
        """Learning rate of each model ``(M, 1)``, or one for all."""
        import torch

        if not self.settings.cosine:
            return self.settings.rate
        taken = self.done * self.steps + np.minimum(step, self.steps - 1)
        rates = 0.5 * self.settings.rate * (1.0 + np.cos(np.pi * taken / (self.steps * self.epochs)))
        return float(rates[0]) if even else torch.from_numpy(rates.astype(np.float32))[:, None]


def _padded(tables: Sequence[FloatArray]) -> torch.Tensor:
    import torch

    longest = max(len(table) for table in tables)
    result = torch.zeros((len(tables), longest, tables[0].shape[1]))
    for index, table in enumerate(tables):
        result[index, : len(table)] = torch.from_numpy(np.asarray(table, dtype=np.float32))
    return result
