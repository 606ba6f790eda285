from __future__ import annotations

import numpy as np
import pytest
import torch

from syda_gym.errors import OptionError
from syda_gym.mappings.models.autoencoder_training import Job, train
from syda_gym.mappings.models.batched import Batch, BatchedNetwork
from syda_gym.mappings.models.settings import TrainingSettings

SMALL = TrainingSettings(hidden_a=(5,), hidden_b=(6, 4), latent=3, cross=0.7, align=0.5, reconstruct=1.3, batch=8)


def autograd_gradient(network: BatchedNetwork, batch: Batch) -> torch.Tensor:
    """The same losses, written with torch's own functions and differentiated by torch."""
    settings = network.settings
    flat = network.flat.detach().clone().requires_grad_(True)
    offset = 0
    total = torch.zeros(())
    layers: dict[str, list[tuple[torch.Tensor, torch.Tensor]]] = {}
    for name, widths in network.layers.items():
        layers[name] = []
        for a, b in zip(widths[:-1], widths[1:], strict=True):
            weight = flat[:, offset : offset + a * b].reshape(-1, a, b)
            bias = flat[:, offset + a * b : offset + a * b + b]
            layers[name].append((weight, bias))
            offset += a * b + b

    def through(name: str, values: torch.Tensor) -> torch.Tensor:
        for index, (weight, bias) in enumerate(layers[name]):
            values = torch.einsum("mbi,mio->mbo", values, weight) + bias[:, None]
            inner = index < len(layers[name]) - 1
            if inner or (settings.activated and name.startswith("encode")):
                values = torch.nn.functional.leaky_relu(values, settings.slope)
        return values

    def error(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        values = torch.nn.functional.huber_loss(x, y, reduction="none", delta=settings.huber).mean(dim=2)
        return values.mean(dim=1).sum() if batch.weight is None else (values * batch.weight).sum()

    z_a = through("encode_a", batch.seen_a)
    if settings.dual:
        z_b = through("encode_b", batch.seen_b)
        total = settings.align * error(z_a, z_b)
        own = error(through("decode_a", z_a), batch.a) + error(through("decode_b", z_b), batch.b)
        cross = error(through("decode_b", z_a), batch.b) + error(through("decode_a", z_b), batch.a)
        total = total + settings.reconstruct * own + settings.cross * cross
    else:
        total = error(through("decode_b", z_a), batch.b)
    return torch.autograd.grad(total, flat)[0]


@pytest.mark.parametrize("dual", [True, False])
@pytest.mark.parametrize("activated", [True, False])
@pytest.mark.parametrize("weighted", [True, False])
def test_the_gradient_is_that_of_autograd(dual, activated, weighted):
    from dataclasses import replace

    settings = replace(SMALL, dual=dual, activated=activated)
    network = BatchedNetwork(settings, 7, 9, [0, 1, 2])
    generator = torch.Generator().manual_seed(0)
    a, b = torch.randn((3, 8, 7), generator=generator), torch.randn((3, 8, 9), generator=generator)
    weight = torch.rand((3, 8), generator=generator) if weighted else None
    batch = Batch(a, b, a + 0.1, b - 0.1, weight, None, 1e-3)
    with torch.no_grad():
        network.differentiate(batch)
    expected = autograd_gradient(network, batch)
    assert torch.allclose(network.gradient, expected, atol=1e-6)


def jobs(counts: list[int]) -> list[Job]:
    rng = np.random.default_rng(0)
    result = []
    for seed, count in enumerate(counts):
        synergies = rng.normal(size=(count, 3))
        result.append(Job(synergies @ rng.normal(size=(3, 7)), synergies @ rng.normal(size=(3, 9)), seed))
    return result


def test_a_batched_model_is_the_model_alone():
    from dataclasses import replace

    settings = replace(SMALL, epochs=5, noise=0.1, cosine=True, decay=0.01)
    together = train(jobs([40, 33, 16]), settings)
    for job, stacks in zip(jobs([40, 33, 16]), together, strict=True):
        (alone,) = train([job], settings)
        for name, stack in alone.items():
            for mine, other in zip(stack.weights, stacks[name].weights, strict=True):
                assert np.allclose(mine, other, atol=1e-5)


def test_small_groups_give_what_one_large_group_gives(monkeypatch):
    from dataclasses import replace

    settings = replace(SMALL, epochs=5, cosine=True, decay=0.01)
    tables = jobs([40, 16, 40, 33, 16])
    seen: list[float] = []
    together = train(tables, settings)
    monkeypatch.setattr("syda_gym.mappings.models.autoencoder_training._WORK", 5000)  # room for two models of this size
    apart = train(tables, settings, seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1.0)
    for one, two in zip(together, apart, strict=True):
        for name, stack in one.items():
            for mine, other in zip(stack.weights, two[name].weights, strict=True):
                assert np.allclose(mine, other, atol=1e-5)


def test_the_same_seed_gives_the_same_bits():
    first, second = (train(jobs([40, 30]), SMALL) for _ in range(2))
    for one, two in zip(first, second, strict=True):
        for name in one:
            assert all(np.array_equal(a, b) for a, b in zip(one[name].weights, two[name].weights, strict=True))


def test_training_lowers_the_error():
    from dataclasses import replace

    (job,) = jobs([200])
    before = train([job], replace(SMALL, epochs=1))[0]
    after = train([job], replace(SMALL, epochs=60, rate=5e-3))[0]

    def error(stacks: dict) -> float:
        return float(np.abs(stacks["decode_b"](stacks["encode_a"](job.a)) - job.b).mean())

    assert error(after) < 0.5 * error(before)


def test_numpy_and_torch_agree():
    (stacks,) = train(jobs([40]), SMALL)
    values = jobs([40])[0].a
    x = torch.from_numpy(values.astype(np.float32))
    encoder = stacks["encode_a"]
    for weight, bias in zip(encoder.weights, encoder.biases, strict=True):
        x = torch.nn.functional.leaky_relu(x @ torch.tensor(weight).float() + torch.tensor(bias).float(), 0.01)
    assert np.abs(encoder(values) - x.numpy()).max() < 1e-6


def test_impossible_settings_are_refused():
    with pytest.raises(OptionError, match="positive"):
        TrainingSettings(latent=0)
    with pytest.raises(OptionError, match="equal widths"):
        train([jobs([20])[0], Job(np.zeros((20, 3)), np.zeros((20, 9)), 0)], SMALL)
