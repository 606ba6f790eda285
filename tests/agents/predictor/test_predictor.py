"""The predictor: torch and numpy agree, it starts as its base, and it learns to beat a tuned filter on noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.classical.rivals import Lead, make_rival
from syda_gym.agents.interface import Interface
from syda_gym.agents.learned.predictor import Predictor, input_count, network_inputs
from syda_gym.agents.learned.tcn import StreamingTcn, TcnShape, receptive_field
from syda_gym.agents.predictor.network import TorchLandmarks, follow, initial_weights, response, tcn
from syda_gym.agents.predictor.predictor_training import PredictorConfig, commands_below, train_predictor
from syda_gym.agents.streams.streams import Streams, play_streams, score_streams
from syda_gym.errors import AgentError


def random_weights(shape: TcnShape, seed: int):
    rng = np.random.default_rng(seed)
    return {name: rng.normal(0, 0.3, size).astype(np.float32) for name, size in shape.shapes().items()}


def test_a_step_at_a_time_in_numpy_equals_the_whole_sequence_in_torch():
    shape = TcnShape(7, 12, 3)
    weights = random_weights(shape, 0)
    inputs = np.random.default_rng(1).normal(size=(4, 60, 7))
    parameters = {name: torch.as_tensor(value, dtype=torch.float64) for name, value in weights.items()}
    whole = tcn(parameters, torch.as_tensor(inputs)).numpy()
    network = StreamingTcn(weights, shape)
    network.reset(4)
    steps = [network.step(inputs[:, t], np.full(4, t == 0)) for t in range(60)]
    assert np.allclose(np.stack(steps, axis=1), whole, atol=1e-10)


def test_the_network_looks_back_exactly_its_receptive_field_and_never_ahead():
    shape = TcnShape(2, 8, 1)
    parameters = {name: torch.as_tensor(value) for name, value in random_weights(shape, 2).items()}
    inputs = torch.zeros(1, 80, 2)
    changed = inputs.clone()
    changed[0, 20] = 5.0
    difference = (tcn(parameters, inputs) - tcn(parameters, changed)).abs()[0, :, 0] > 1e-6
    touched = np.flatnonzero(difference.numpy())
    assert touched.min() == 20
    assert touched.max() <= 20 + receptive_field() - 1
    assert touched.max() >= 20 + receptive_field() - 3


def test_torch_kinematics_equal_the_robots_own(interface):
    rng = np.random.default_rng(3)
    q = rng.uniform(interface.robot.lower, interface.robot.upper, (20, interface.n))
    ours = TorchLandmarks(interface)(torch.as_tensor(q, dtype=torch.float32)).numpy()
    assert np.allclose(ours, interface.robot.landmarks(q), atol=1e-5)


def test_the_motor_law_as_one_product_equals_step_after_step():
    rng = np.random.default_rng(4)
    commands, start = rng.normal(size=(3, 12, 2)), rng.normal(size=(3, 2))
    shares = np.array([[0.5], [0.9], [1.3]])
    q, steps = start, []
    for t in range(12):
        q = q + shares * (commands[:, t] - q)
        steps.append(q)
    as_tensor = [torch.as_tensor(values, dtype=torch.float32) for values in (commands, start)]
    assert np.allclose(follow(*as_tensor, response(shares, 12)).numpy(), np.stack(steps, axis=1), atol=1e-5)


def test_an_untrained_predictor_is_its_base(interface, noisy_streams, rates):
    _, test = noisy_streams
    shape = TcnShape(input_count(interface), 16, interface.n)
    weights = {name: value.detach().numpy() for name, value in initial_weights(shape, 0).items()}
    predictor = Predictor(interface, BaseAlone(interface), weights=weights, channels=16)
    base = play_streams(BaseAlone(interface), test, rates)
    assert np.array_equal(play_streams(predictor, test, rates), base)


def test_it_beats_the_base_and_the_lead_on_noise_it_has_not_seen(interface, noisy_streams, rates):
    train, test = noisy_streams
    config = PredictorConfig(iterations=80, rounds=1, batch=16, channels=24, averaging=0.9)
    trained = train_predictor(BaseAlone(interface), train, test, rates, config, seed=0)
    learned = trained.history[trained.best].objective
    rivals = [make_rival("lead", interface, strength=strength) for strength in (0.0, 1.0)]
    assert learned < 0.95 * min(score_streams(agent, test, rates).objective for agent in rivals)
    assert trained.agent.stack == ("base", "predictor", "lead")


def test_same_seed_same_weights_and_another_seed_others(interface, noisy_streams, rates):
    train, test = noisy_streams
    config = PredictorConfig(iterations=3, rounds=1, batch=8, channels=8)
    runs = [
        train_predictor(BaseAlone(interface), train, test, rates, config, seed=seed).agent.base.weights
        for seed in (1, 1, 2)
    ]
    assert all(np.array_equal(runs[0][name], runs[1][name]) for name in runs[0])
    assert not np.array_equal(runs[0]["inlet.weight"], runs[2]["inlet.weight"])


def test_commands_below_are_those_of_the_agent(interface, noisy_streams):
    _, test = noisy_streams
    assert np.allclose(commands_below(BaseAlone(interface), test), interface.robot.clamp(
        test.base.reshape(-1, interface.n)).reshape(test.base.shape))  # fmt: skip


def test_wrong_weights_and_settings_are_refused(interface):
    with pytest.raises(AgentError, match=r"'inlet\.weight' has shape None"):
        Predictor(interface, BaseAlone(interface), weights={})
    with pytest.raises(AgentError, match="rounds need at least"):
        PredictorConfig(iterations=2, rounds=5)
    with pytest.raises(AgentError, match="averaging"):
        PredictorConfig(averaging=1.0)
    with pytest.raises(AgentError, match="strength"):
        Lead(interface, BaseAlone(interface), strength=-1.0)


def test_a_base_that_looks_at_joint_angles_is_refused(interface, noisy_streams, rates):
    train, test = noisy_streams
    with pytest.raises(AgentError, match="cannot stand on 'lead'"):
        train_predictor(make_rival("lead", interface), train, test, rates)


def test_it_sees_the_base_command_beside_that_of_the_agent_below(interface):
    values = np.random.default_rng(5).normal(size=(4, interface.n))
    one = network_inputs(interface, values[0], values[1], values[2:3], values[3], np.array(0.1))
    other = network_inputs(interface, values[0], values[1], values[2:3] + 1.0, values[3], np.array(0.1))
    changed = np.flatnonzero(one != other)
    assert one.shape == (input_count(interface),)
    assert changed.tolist() == list(range(2 * interface.n, 3 * interface.n))


def looking_ahead(interface: Interface, streams: Streams, steps: int) -> tuple[Interface, Streams]:
    """The same episodes where the base commands to come are shown."""
    n, shown = interface.n, slice(0, (steps + 1) * interface.n)
    layout = {"base_error": shown}
    for name, width in (("q", n), ("qd", n), ("packet_age", 1)):
        start = list(layout.values())[-1].stop
        layout[name] = slice(start, start + width)
    size = list(layout.values())[-1].stop
    times = np.arange(streams.base.shape[1])
    later = np.minimum(times[:, None] + np.arange(1, steps + 1), times[-1])
    return Interface(interface.robot, layout, size, interface.dt, interface.alpha), replace(
        streams, ahead=streams.base[:, later]
    )


def test_commands_to_come_are_seen_and_help_against_noise(interface, noisy_streams, rates):
    config = PredictorConfig(iterations=60, rounds=1, batch=16, channels=24, averaging=0.9)
    ahead, _ = looking_ahead(interface, noisy_streams[0], 3)
    train, test = (looking_ahead(interface, streams, 3)[1] for streams in noisy_streams)
    assert input_count(ahead) == input_count(interface) + 3 * interface.n
    learned = [
        train_predictor(BaseAlone(one), *streams, rates, config, seed=0).history[-1].objective
        for one, streams in ((ahead, (train, test)), (interface, noisy_streams))
    ]
    assert learned[0] < 0.97 * learned[1]
