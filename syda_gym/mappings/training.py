"""Training: many dual autoencoders at once, as one batched network (``torch.baddbmm``)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.errors import OptionError
from syda_gym.mappings.networks import Stack

if TYPE_CHECKING:
    import torch

__all__ = ["Job", "Progress", "TrainingSettings", "train"]

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


@dataclass(frozen=True)
class TrainingSettings:
    """Sizes, losses and optimiser, equal for all jobs of a batch.

    Attributes:
        hidden_a: widths between A's code and the latent features; the decoder mirrors them.
        hidden_b: the same for B.
        latent: number of latent features (synergies).
        slope: of the leaky ReLU; 1 for linear networks.
        activated: whether the latent features are activated too, as Eq. 1 has it for every layer.
        dual: the dual autoencoder; otherwise only A's encoder and B's decoder are built.
        reconstruct: weight of A-to-A and B-to-B, Eq. 2 and 3.
        align: weight of the latent loss, Eq. 4.
        cross: weight of A-to-B and B-to-A.
        huber: width of the Huber loss's quadratic part.
        rate: learning rate of Adam.
        decay: decoupled weight decay (AdamW).
        cosine: let the rate fall to zero along a half cosine.
        batch: rows a step.
        epochs: passes over the rows.
        max_steps: upper bound of the number of steps; epochs are cut for larger data sets.
        noise: standard deviation of the noise added to the inputs (codes are standardised then).
    """

    hidden_a: tuple[int, ...] = (16, 14, 12)
    hidden_b: tuple[int, ...] = (32, 24, 16)
    latent: int = 10
    slope: float = 0.01
    activated: bool = True
    dual: bool = True
    reconstruct: float = 1.0
    align: float = 1.0
    cross: float = 0.0
    huber: float = 0.6
    rate: float = 1e-3
    decay: float = 0.0
    cosine: bool = False
    batch: int = 20
    epochs: int = 200
    max_steps: int | None = None
    noise: float = 0.0

    def __post_init__(self) -> None:
        widths = (*self.hidden_a, *self.hidden_b, self.latent, self.batch, self.epochs)
        if min(widths) < 1 or not (self.rate > 0 and self.huber > 0 and self.noise >= 0 and self.decay >= 0):
            raise OptionError(f"sizes, batch, epochs, rate and huber must be positive, noise and decay >= 0: {self}")

    def stacks(self, width_a: int, width_b: int) -> dict[str, tuple[int, ...]]:
        """Layer widths of each stack, input and output included."""
        encode_a = (width_a, *self.hidden_a, self.latent)
        encode_b = (width_b, *self.hidden_b, self.latent)
        if not self.dual:
            return {"encode_a": encode_a, "decode_b": encode_b[::-1]}
        return {"encode_a": encode_a, "decode_a": encode_a[::-1], "encode_b": encode_b, "decode_b": encode_b[::-1]}


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
    layers = settings.stacks(*widths.pop())
    data_a, data_b = _padded([job.a for job in jobs]), _padded([job.b for job in jobs])
    plan = _Plan(jobs, settings)
    flat = torch.stack([_initial(layers, job.seed) for job in jobs]).requires_grad_(True)
    adam = _Adam(flat, settings)
    for step in range(plan.steps):
        rows, weight, active = plan.step(step)
        x = torch.gather(data_a, 1, rows[:, :, None].expand(-1, -1, data_a.shape[2]))
        y = torch.gather(data_b, 1, rows[:, :, None].expand(-1, -1, data_b.shape[2]))
        loss = _loss(_views(flat, layers), x, y, plan.noise(x), plan.noise(y), weight, settings)
        (gradient,) = torch.autograd.grad(loss, flat)
        adam.update(gradient, active, plan.rate(step))
        if progress is not None and (step % 50 == 0 or step + 1 == plan.steps):
            progress((step + 1) / plan.steps)
    values = flat.detach().numpy()
    return [_stacks(row, layers, settings) for row in values]


class _Plan:
    """Which rows each model sees in each step, and with which noise and rate."""

    def __init__(self, jobs: Sequence[Job], settings: TrainingSettings) -> None:
        import torch

        self.settings = settings
        self.counts = np.array([len(job.a) for job in jobs])
        self.orders = [np.random.default_rng([job.seed, 1]) for job in jobs]
        self.noises = [torch.Generator().manual_seed(int(job.seed) * 2 + 1) for job in jobs]
        self.per_epoch = np.ceil(self.counts / settings.batch).astype(int)
        epochs = settings.epochs
        if settings.max_steps is not None:
            epochs = max(1, min(epochs, settings.max_steps // int(self.per_epoch.max())))
        self.totals = self.per_epoch * epochs
        self.width = int(self.per_epoch.max())
        self.steps = self.width * epochs
        self.ragged = len(set(self.counts.tolist())) > 1 or bool(self.counts[0] % settings.batch)
        self.taken = np.zeros(len(jobs))
        self._rows = np.zeros((len(jobs), 0), dtype=np.int64)

    def step(self, step: int) -> tuple[torch.Tensor, torch.Tensor | None, torch.Tensor | None]:
        """Rows ``(M, B)``, their weights (``None`` if all equal), and which models take part (``None`` if all)."""
        import torch

        batch = self.settings.batch
        within = step % self.width
        if within == 0:
            self._shuffle()
        columns = slice(within * batch, (within + 1) * batch)
        rows = torch.from_numpy(np.ascontiguousarray(self._rows[:, columns]))
        if not self.ragged:
            self.taken += 1
            return rows, None, None
        valid = np.arange(columns.start, columns.stop)[None] < self.counts[:, None]
        active = valid.any(axis=1)
        self.taken += active
        weight = valid / np.maximum(valid.sum(axis=1, keepdims=True), 1)
        all_active = bool(active.all())
        return (
            rows,
            torch.from_numpy(weight.astype(np.float32)),
            None if all_active else torch.from_numpy(active)[:, None],
        )

    def _shuffle(self) -> None:
        size = self.width * self.settings.batch
        rows = np.zeros((len(self.counts), size), dtype=np.int64)
        for model, (count, order) in enumerate(zip(self.counts, self.orders, strict=True)):
            rows[model, :count] = order.permutation(count)
        self._rows = rows

    def noise(self, values: torch.Tensor) -> torch.Tensor:
        """The values with fresh noise."""
        import torch

        if self.settings.noise == 0.0:
            return values
        shape = values.shape[1:]
        drawn = torch.stack([torch.randn(shape, generator=generator) for generator in self.noises])
        return values + self.settings.noise * drawn

    def rate(self, step: int) -> torch.Tensor | float:
        """Learning rate of each model ``(M, 1)``, or one for all."""
        import torch

        if not self.settings.cosine:
            return self.settings.rate
        done = (self.taken - 1) / self.totals
        factors = 0.5 * (1.0 + np.cos(np.pi * np.clip(done, 0.0, 1.0)))
        return torch.from_numpy((self.settings.rate * factors).astype(np.float32))[:, None]


class _Adam:
    """AdamW on flat parameters ``(M, P)``; models that sit a step out keep their state."""

    def __init__(self, flat: torch.Tensor, settings: TrainingSettings) -> None:
        import torch

        self.flat = flat
        self.decay = settings.decay
        self.mean = torch.zeros_like(flat, requires_grad=False)
        self.square = torch.zeros_like(flat, requires_grad=False)
        self.count = torch.zeros((len(flat), 1))

    def update(self, gradient: torch.Tensor, active: torch.Tensor | None, rate: torch.Tensor | float) -> None:
        import torch

        with torch.no_grad():
            if active is None:
                self.mean.mul_(0.9).add_(gradient, alpha=0.1)
                self.square.mul_(0.999).addcmul_(gradient, gradient, value=0.001)
                self.count += 1
            else:
                self.mean = torch.where(active, 0.9 * self.mean + 0.1 * gradient, self.mean)
                self.square = torch.where(active, 0.999 * self.square + 0.001 * gradient**2, self.square)
                self.count = torch.where(active, self.count + 1, self.count)
            count = self.count.clamp(min=1.0)
            scale = rate / (1.0 - 0.9**count)
            step = self.mean / ((self.square / (1.0 - 0.999**count)).sqrt_().add_(1e-8)) * scale
            if self.decay:
                step = step + rate * self.decay * self.flat
            self.flat -= step if active is None else torch.where(active, step, torch.zeros_like(step))


def _loss(
    nets: dict[str, list[tuple[torch.Tensor, torch.Tensor]]],
    a: torch.Tensor,
    b: torch.Tensor,
    seen_a: torch.Tensor,
    seen_b: torch.Tensor,
    weight: torch.Tensor | None,
    settings: TrainingSettings,
) -> torch.Tensor:
    def error(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        import torch

        if weight is None:
            return torch.nn.functional.huber_loss(x, y, reduction="sum", delta=settings.huber) / x[0].numel()
        values = torch.nn.functional.huber_loss(x, y, reduction="none", delta=settings.huber)
        return (values.mean(dim=2) * weight).sum()

    def through(name: str, values: torch.Tensor) -> torch.Tensor:
        activated = settings.activated and name.startswith("encode")
        return _apply(nets[name], values, settings.slope, activated)

    z_a = through("encode_a", seen_a)
    if not settings.dual:
        return error(through("decode_b", z_a), b)
    z_b = through("encode_b", seen_b)
    loss = settings.reconstruct * (error(through("decode_a", z_a), a) + error(through("decode_b", z_b), b))
    loss = loss + settings.align * error(z_a, z_b)
    if settings.cross:
        loss = loss + settings.cross * (error(through("decode_b", z_a), b) + error(through("decode_a", z_b), a))
    return loss


def _apply(
    layers: list[tuple[torch.Tensor, torch.Tensor]], values: torch.Tensor, slope: float, activated: bool
) -> torch.Tensor:
    import torch

    last = len(layers) - (0 if activated else 1)
    for index, (weight, bias) in enumerate(layers):
        values = torch.baddbmm(bias, values, weight)
        if index < last and slope != 1.0:
            values = torch.nn.functional.leaky_relu(values, slope)
    return values


def _sizes(layers: dict[str, tuple[int, ...]]) -> list[int]:
    return [
        size for widths in layers.values() for a, b in zip(widths[:-1], widths[1:], strict=True) for size in (a * b, b)
    ]


def _views(
    flat: torch.Tensor, layers: dict[str, tuple[int, ...]]
) -> dict[str, list[tuple[torch.Tensor, torch.Tensor]]]:
    import torch

    parts = iter(torch.split(flat, _sizes(layers), dim=1))
    return {
        name: [
            (next(parts).reshape(len(flat), a, b), next(parts)[:, None])
            for a, b in zip(widths[:-1], widths[1:], strict=True)
        ]
        for name, widths in layers.items()
    }


def _initial(layers: dict[str, tuple[int, ...]], seed: int) -> torch.Tensor:
    """Glorot-uniform weights and zero biases as one flat vector."""
    import torch

    generator = torch.Generator().manual_seed(int(seed) * 2)
    parts = []
    for widths in layers.values():
        for a, b in zip(widths[:-1], widths[1:], strict=True):
            bound = math.sqrt(6.0 / (a + b))
            parts.append((torch.rand(a * b, generator=generator) * 2.0 - 1.0) * bound)
            parts.append(torch.zeros(b))
    return torch.cat(parts)


def _stacks(values: FloatArray, layers: dict[str, tuple[int, ...]], settings: TrainingSettings) -> dict[str, Stack]:
    parts = iter(np.split(values, np.cumsum(_sizes(layers))[:-1]))
    result = {}
    for name, widths in layers.items():
        weights, biases = [], []
        for a, b in zip(widths[:-1], widths[1:], strict=True):
            weights.append(next(parts).reshape(a, b))
            biases.append(next(parts))
        result[name] = Stack(weights, biases, settings.slope, settings.activated and name.startswith("encode"))
    return result


def _padded(tables: Sequence[FloatArray]) -> torch.Tensor:
    import torch

    longest = max(len(table) for table in tables)
    result = torch.zeros((len(tables), longest, tables[0].shape[1]))
    for index, table in enumerate(tables):
        result[index, : len(table)] = torch.from_numpy(np.asarray(table, dtype=np.float32))
    return result
