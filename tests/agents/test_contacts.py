"""Contacts: projection leaves them by little, free poses alone, and avoiding references are free and smooth."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch

from syda_gym.agents.agent import BaseAlone
from syda_gym.agents.classical.avoidance import avoiding
from syda_gym.agents.classical.projection import Projection, capsule_model
from syda_gym.agents.classical.rivals import make_rival
from syda_gym.agents.classical.sliding import Sliding
from syda_gym.agents.figures import Figures, jitter
from syda_gym.agents.predictor.contact_term import ContactTerm
from syda_gym.agents.predictor.predictor_training import PredictorConfig, train_predictor
from syda_gym.agents.stacks import build_stack, stack_spec
from syda_gym.agents.streams.streams import Streams, play_streams, score_streams
from syda_gym.errors import AgentError
from syda_gym.motions.synthetic.generator import generate
from syda_gym.simulation.collision.self_collision import SelfCollision


@pytest.fixture(scope="module")
def crossing() -> Streams:
    """Pepper's own motions that drive its arms into its body."""
    motions = generate(("pepper",), seed=7, actions=("cross_chest", "reach_across"), variants=1)
    frames = [take.frames["pepper"][20:80] for take in motions.takes]
    reference = np.stack(frames)
    return Streams(reference, np.zeros(reference.shape[:2]), reference, np.full(len(frames), 60))


def test_projection_leaves_contact_and_moves_little(interface):
    model = capsule_model(interface.robot)
    rng = np.random.default_rng(0)
    robot = interface.robot
    poses = robot.clamp(rng.uniform(robot.lower, robot.upper, (600, interface.n)))
    clear = model.clearance(poses)
    touching = poses[(clear < 0.0) & (clear > -0.05)]
    assert len(touching) > 10
    projection = Projection(interface, BaseAlone(interface), margin=0.01)
    found = projection.project(touching)
    assert (model.clearance(found) > 0.0).mean() > 0.9
    assert np.median(np.abs(found - touching).max(axis=1)) < 0.4
    assert not robot.violations(found).any()


def test_free_commands_pass_bit_for_bit(interface):
    projection = Projection(interface, BaseAlone(interface), margin=0.005)
    projection.reset(1)
    rest = interface.robot.rest[None]
    assert np.array_equal(projection.project(rest), rest)


def test_the_projecting_rival_touches_far_less_than_the_base(interface, crossing, rates):
    model = capsule_model(interface.robot)
    base = score_streams(make_rival("base", interface), crossing, rates, capsules=model)
    projected = score_streams(make_rival("projection", interface, margin=0.005), crossing, rates, capsules=model)
    assert base.contact_steps > 0.2
    assert projected.contact_steps < 0.4 * base.contact_steps  # the clips begin inside a contact


def test_sliding_keeps_its_distance_once_it_is_free(interface, crossing, rates):
    exact = SelfCollision(interface.robot, 0.0)

    def nearest(q: np.ndarray) -> float:
        found = exact.near(q, 0.05)[0]
        return float(found.min()) if len(found) else 0.05

    q, rows = {}, range(20, 60)  # the clips begin inside a contact
    for name in ("base", "sliding_lead"):
        q[name] = play_streams(make_rival(name, interface), crossing, rates)
    clear = {name: np.array([[nearest(found[e, t]) for t in rows] for e in range(2)]) for name, found in q.items()}
    assert (clear["base"] < 0.0).mean() > 0.2
    assert (clear["sliding_lead"] > 0.0).all()
    assert np.abs(q["sliding_lead"] - crossing.reference)[:, 20:].mean() < 0.03  # it does not stay behind


def test_sliding_leaves_free_commands_alone_is_stored_and_refuses_nonsense(interface, rates):
    rest = np.tile(interface.robot.rest, (1, 10, 1))
    streams = Streams(rest, np.zeros((1, 10)), rest, np.array([10]))
    lead, sliding = make_rival("lead", interface), make_rival("sliding_lead", interface, margin=0.001)
    assert np.array_equal(play_streams(lead, streams, rates), play_streams(sliding, streams, rates))
    assert sliding.stack == ("base", "lead", "sliding")
    again = build_stack(interface, stack_spec(sliding))
    assert again.settings == {"margin": 0.001, "approach": 0.9}
    with pytest.raises(AgentError, match="approach"):
        Sliding(interface, BaseAlone(interface), approach=0.0)


def test_avoiding_references_are_free_near_the_old_ones_and_smoother_than_projection(interface, crossing):
    model = capsule_model(interface.robot)
    found = avoiding(crossing, interface, margin=0.01)
    flat = found.reference.reshape(-1, interface.n)
    assert (model.clearance(flat) > 0.0).mean() > 0.97
    assert np.array_equal(found.base, crossing.base)
    projection = Projection(interface, BaseAlone(interface), margin=0.01)
    abrupt = projection.project(crossing.reference.reshape(flat.shape)).reshape(found.reference.shape)
    robot = interface.robot
    roughness = [sum(jitter(robot.landmarks(q)) for q in motion) for motion in (found.reference, abrupt)]
    assert roughness[0] < roughness[1]


def test_avoiding_leaves_motions_without_contact_as_they_are(interface):
    rest = np.tile(interface.robot.rest, (1, 10, 1))
    streams = Streams(rest, np.zeros((1, 10)), rest, np.array([10]))
    assert np.array_equal(avoiding(streams, interface).reference, rest)


def test_a_margin_out_of_range_is_refused(interface):
    with pytest.raises(AgentError, match="margin"):
        Projection(interface, BaseAlone(interface), margin=-0.1)


def test_overlap_costs_its_depth_and_pushes_out(interface, crossing):
    model = capsule_model(interface.robot)
    term = ContactTerm(interface.robot, margin=0.01)
    q = crossing.reference[:, 10:20]
    term.renew(q)
    at = (torch.arange(len(q))[:, None], torch.arange(10)[None].expand(len(q), 10))
    angles = torch.as_tensor(q, dtype=torch.float32).requires_grad_()
    depth = term(at, angles)
    distances = np.sort(model.distances(q.reshape(-1, interface.n)), axis=1)[:, :4]
    expected = 1e3 * np.maximum(0.01 - distances, 0.0).sum(axis=1)
    assert expected.max() > 5.0
    assert np.allclose(depth.detach().numpy().ravel(), expected, atol=0.01)
    depth.sum().backward()
    moved = q - 1e-4 * angles.grad.numpy() / np.abs(angles.grad.numpy()).max()
    shallower = term(at, torch.as_tensor(moved, dtype=torch.float32)).detach()
    assert shallower.sum() < depth.detach().sum()


def test_a_predictor_on_the_projection_starts_as_it_and_is_judged_by_contacts_too(interface, crossing, rates):
    config = PredictorConfig(
        channels=8, iterations=6, batch=2, window=20, rounds=1, mirror=False, contact_weight=1.0, contact_margin=0.002
    )
    base = Projection(interface, BaseAlone(interface), margin=0.0)
    trained = train_predictor(base, crossing, crossing, rates, config)
    rival = make_rival("projection_lead", interface, margin=0.0)
    assert trained.history[0] == score_streams(rival, crossing, rates, capsules=capsule_model(interface.robot))
    assert len(trained.history) == 2
    assert trained.agent.stack == ("base", "projection", "predictor", "lead")
    with pytest.raises(AgentError, match="contact_margin"):
        PredictorConfig(contact_weight=1.0, contact_margin=1.0)


@pytest.fixture(scope="module")
def study() -> ModuleType:
    path = Path(__file__).parents[2] / "scripts" / "study_contacts.py"
    spec = importlib.util.spec_from_file_location("study_contacts", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_study_chooses_the_least_j_among_settings_with_few_contacts(study):
    base = Figures(9.0, 10.0, 1.0, 0.1)
    settings = {
        "touches": Figures(1.0, 10.0, 1.0, 0.02),
        "clear": Figures(2.0, 10.0, 1.0, 0.005),
        "clearest": Figures(3.0, 10.0, 1.0, 0.0),
    }
    assert study.choose(base, settings) == "clear"
    assert study.choose(Figures(9.0, 10.0, 1.0, 0.01), settings) == "clearest"
    del settings["clear"], settings["clearest"]
    assert study.choose(base, settings) == "touches"


def test_the_study_judges_by_bullet_with_self_collision(study):
    judged = study.in_bullet(study.VALIDATION, 102)
    assert judged.physics == "bullet"
    assert judged.self_collision
    assert not {*study.TRAIN, *study.VALIDATION} & set(study.TEST)
