"""The dry run: what is expected of a route, before anything is recorded."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import syda_gym
from syda_gym.embodiments import catalog
from syda_gym.embodiments.embodiment import landmark_error
from syda_gym.embodiments.parametric import parametric_human
from syda_gym.errors import EmbodimentError, MotionError, OptionError, RouteError
from syda_gym.routes import best_route, ranked_routes, spanning_pairs, suggest
from syda_gym.routes.dry_run import memory
from syda_gym.routes.dry_run.imitation import follow, imitate, track
from syda_gym.routes.dry_run.memory import default_plan
from syda_gym.routes.dry_run.plan import FPS, Plan, limb_directions, plan_from_motions
from syda_gym.routes.dry_run.rehearsal import Rehearsal

NAMES = ("adult", "kid", "pepper", "nao")


@pytest.fixture(scope="module")
def bodies():
    return {name: catalog.get(name) for name in NAMES}


@pytest.fixture(scope="module")
def together(bodies):
    return Rehearsal(bodies, default_plan())


class TestPlan:
    def test_a_clip_keeps_its_tempo(self) -> None:
        adult = catalog.get("adult")
        take = syda_gym.load_motions("embedded").takes[0]
        frames = take.frames["adult"][:91]
        slow, fast = limb_directions(adult, frames, 30.0), limb_directions(adult, frames, 60.0)
        assert len(slow) == 46
        assert len(fast) == 23
        assert np.allclose(slow[::2], fast)
        assert np.allclose(np.linalg.norm(slow, axis=-1), 1.0)

    def test_who_performs_it_facing_elsewhere_plans_the_same(self) -> None:
        adult = catalog.get("adult")
        take = syda_gym.load_motions("embedded").takes[0]
        points = adult.arm_points(take.frames["adult"])
        turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        turned = adult.frames_from_points(points @ turn.T)
        assert np.allclose(
            limb_directions(adult, turned, take.fps), limb_directions(adult, take.frames["adult"], take.fps), atol=1e-6
        )

    def test_the_default_holds_many_actions(self) -> None:
        plan = default_plan()
        assert len(plan) == 32
        assert len(set(plan.actions)) > 20

    def test_what_holds_nothing_is_named(self) -> None:
        motions = syda_gym.load_motions("embedded")
        with pytest.raises(MotionError, match="no clip of 'ghost'"):
            plan_from_motions(motions, "ghost")
        with pytest.raises(MotionError, match="one action per clip"):
            Plan((), ())
        with pytest.raises(MotionError, match="two or more"):
            Rehearsal({"adult": catalog.get("adult")}, Plan(default_plan().clips[:1], ("wave",)))


class TestImitation:
    def test_a_robot_keeps_limits_and_speeds_and_points_where_it_can(self) -> None:
        pepper = catalog.get("pepper")
        wanted = np.stack([clip[:45] for clip in default_plan().clips if len(clip) >= 45][:4])
        seen = []

        def watched(robot, index, arm):
            found = track(robot, index, arm)
            seen.append(found)
            return found

        shown = imitate(pepper, Plan(tuple(wanted), ("a", "b", "c", "d")), watched)
        angle = np.degrees(np.arccos(np.clip((shown[0]["left"] * wanted[0][:, 0]).sum(-1), -1, 1)))
        assert len(seen) == 2
        assert np.median(angle) < 15.0

    def test_a_slow_robot_lags_behind(self, bodies) -> None:
        quick = catalog.get("pepper")
        slow = type(quick)(quick.description)
        slow.speed = quick.speed * 0.05
        plan = Plan(default_plan().clips[:4], default_plan().actions[:4])

        def off(robot):
            pairs = zip(imitate(robot, plan), plan.clips, strict=True)
            return np.mean([np.linalg.norm(shown["left"] - clip[:, 0], axis=-1).mean() for shown, clip in pairs])

        assert off(slow) > 1.5 * off(quick)

    def test_by_default_the_librarys_own_solver_leads_and_comes_nearer_than_the_tracker(self, bodies) -> None:
        plan = Plan(default_plan().clips[:6], default_plan().actions[:6])
        for name in ("pepper", "nao"):
            robot = bodies[name]
            own, tracked = imitate(robot, plan), imitate(robot, plan, track)
            off = [
                np.mean([np.linalg.norm(one["right"] - clip[:, 1], axis=-1).mean() for one, clip in zip(
                    shown, plan.clips, strict=True
                )]) for shown in (own, tracked)
            ]  # fmt: skip
            assert off[0] < 0.8 * off[1]

    def test_the_solver_keeps_joint_speeds_and_does_not_mind_other_clips(self, bodies) -> None:
        pepper = bodies["pepper"]
        clip = default_plan().clips[0]
        alone, together = follow(pepper, clip[None]), follow(pepper, np.stack([clip[::-1], clip]))
        assert np.array_equal(alone[0], together[1])
        jump = np.concatenate([np.repeat(clip[:1], 5, axis=0), np.repeat(clip[40:41], 5, axis=0)])[None]
        quick, slow = pepper, type(pepper)(pepper.description)
        slow.speed = pepper.speed * 0.1
        missed = [np.linalg.norm(follow(one, jump)[0, 5] - jump[0, 5], axis=-1).mean() for one in (quick, slow)]
        assert missed[1] > missed[0]

    def test_a_human_imitates_exactly_unless_stiff(self) -> None:
        plan = Plan(default_plan().clips[:2], ("a", "b"))
        assert np.array_equal(imitate(catalog.get("kid"), plan)[0]["left"], plan.clips[0][:, 0])
        stiff = imitate(catalog.get("stiff"), plan)[0]["left"]
        assert not np.allclose(stiff, plan.clips[0][:, 0])

    def test_a_retargeter_that_gives_nonsense_is_refused(self) -> None:
        with pytest.raises(EmbodimentError, match="same shape"):
            imitate(catalog.get("pepper"), default_plan(), lambda robot, index, arm: arm[:1])

    def test_shipped_imitations_are_those_that_are_computed(self, monkeypatch) -> None:
        plan = default_plan()
        part = Plan(plan.clips[3:5], plan.actions[3:5])
        nao = catalog.get("nao")
        stored = memory.imitation_of(nao, part)
        assert all(memory.imitation_key(nao, clip) in memory._shipped() for clip in part.clips)
        fresh = imitate(nao, part)
        for one, other in zip(stored, fresh, strict=True):
            # Clips are padded to the longest of the plan, which changes nothing of the frames before.
            assert all(np.allclose(one[side], other[side], atol=1e-6) for side in nao.sides)


class TestScore:
    def test_terms_lie_in_their_ranges(self, together) -> None:
        for route in [*permutations(NAMES, 2), *permutations(NAMES, 3), *permutations(NAMES, 4)]:
            score = together.score(route)
            assert 0.0 <= score.S <= score.C <= 1.0
            assert 0.0 <= score.D <= 1.0
            assert 0.0 < score.alpha <= 1.0
            assert pytest.approx(score.alpha * score.C) == score.T
            assert score.error > 0.0
            assert score.standard_error > 0.0

    def test_the_same_seed_gives_the_same_bits_whoever_else_rehearses(self, bodies, together) -> None:
        pair = Rehearsal({name: bodies[name] for name in ("kid", "pepper")}, default_plan())
        assert pair.score(("kid", "pepper")) == together.score(("kid", "pepper"))
        assert Rehearsal(bodies, default_plan(), seed=1).score(("kid", "pepper")) != together.score(("kid", "pepper"))

    def test_noise_costs_and_a_detour_never_helps_much(self, bodies, together) -> None:
        noisy = Rehearsal(bodies, default_plan(), sensor={"adult": 0.05})
        assert noisy.score(("adult", "pepper")).error > together.score(("adult", "pepper")).error
        assert noisy.score(("adult", "pepper")).alpha < together.score(("adult", "pepper")).alpha
        margin, noise = together.margin(("adult", "pepper"), ("adult", "nao", "pepper"))
        assert margin > -2.0 * noise

    def test_what_a_body_cannot_show_is_lost_once(self, bodies) -> None:
        """A stiff body between costs; passing it twice in effect (by a second stiff one) costs no second time."""
        stiff = {name: parametric_human(name, mobility=0.35) for name in ("stiff_one", "stiff_two")}
        run = Rehearsal({**bodies, **stiff}, default_plan(), sensor=dict.fromkeys(stiff, 0.0), imprecision={
            name: 0.0 for name in (*bodies, *stiff)
        })  # fmt: skip
        free = run.score(("adult", "kid", "pepper")).relative
        once = run.score(("adult", "stiff_one", "pepper")).relative
        twice = run.score(("adult", "stiff_one", "stiff_two", "pepper")).relative
        assert once > 1.1 * free
        assert twice - once < 0.5 * (once - free)

    def test_one_armed_bodies_are_judged_with_a_note(self) -> None:
        t = syda_gym.transferability("left_only", "adult")
        assert t.coverage == 0.5
        assert "missing one is guessed" in t.notes[0]
        assert t.error > 1.3 * syda_gym.transferability("tall", "adult").error
        follow = syda_gym.transferability("adult", "left_only")
        assert "only the left arm counts" in follow.notes[0]

    def test_bad_input_is_named(self, bodies, together) -> None:
        with pytest.raises(RouteError, match="'ghost' does not rehearse here"):
            together.score(("adult", "ghost"))
        with pytest.raises(RouteError, match="two bodies"):
            together.score(("adult",))
        with pytest.raises(OptionError, match="sensor of 'adult'"):
            Rehearsal(bodies, default_plan(), sensor={"adult": -1.0})
        with pytest.raises(OptionError, match="did you mean 'adult'"):
            Rehearsal(bodies, default_plan(), sensor={"adlt": 0.01})
        with pytest.raises(OptionError, match="either plan= or motions="):
            syda_gym.transferability("adult", "pepper", plan=default_plan(), motions="embedded")

    def test_a_body_that_cannot_imitate_at_all_is_named_and_never_a_zero(self, bodies) -> None:
        frozen = type(bodies["pepper"])(bodies["pepper"].description)
        frozen.speed = frozen.speed * 0.0
        run = Rehearsal({**bodies, "pepper": frozen}, default_plan(), retargeter=track)
        # A robot that does not move keeps its first pose per clip; with one pose for all there is nothing to judge.
        still = Rehearsal({**bodies}, default_plan(), retargeter=lambda robot, index, arm: np.broadcast_to(
            arm[:1, :1], arm.shape
        ))  # fmt: skip
        assert run.score(("adult", "pepper")).error > 0.0
        with pytest.raises(EmbodimentError, match="'pepper' cannot imitate the planned motion at all"):
            still.score(("adult", "pepper"))

    @settings(max_examples=20, deadline=None)
    @given(st.floats(0.0, 0.06))
    def test_alpha_falls_with_the_sensor(self, sigma: float) -> None:
        bodies = {name: catalog.get(name) for name in ("kid", "pepper")}
        less, more = (Rehearsal(bodies, default_plan(), sensor={"kid": s}) for s in (sigma, sigma + 0.02))
        assert more.score(("kid", "pepper")).alpha <= less.score(("kid", "pepper")).alpha + 0.01


class TestRouting:
    def test_it_is_what_everything_asks_by_default(self) -> None:
        t = syda_gym.transferability("adult", "pepper")
        assert t.definition == "dry_run"
        assert t.error == pytest.approx(0.0335, abs=0.002)
        route = best_route("adult", "pepper", [("adult", "pepper")])
        assert route.error == t.error
        assert route.links == (t,)

    def test_ties_are_margins_below_their_standard_error(self) -> None:
        pairs = [("adult", "kid"), ("kid", "pepper"), ("adult", "tall"), ("tall", "pepper"), ("adult", "stiff"),
                 ("stiff", "pepper")]  # fmt: skip
        best = best_route("adult", "pepper", pairs, max_hops=2)
        ranked = ranked_routes("adult", "pepper", pairs, max_hops=2)
        assert [route.error for route in ranked] == sorted(route.error for route in ranked)
        tied = {route.bodies for route in best.ties}
        assert ("adult", "stiff", "pepper") not in tied | {best.bodies}

    def test_three_hops_unless_said_otherwise(self) -> None:
        line = [("adult", "kid"), ("kid", "tall"), ("tall", "nao"), ("nao", "pepper")]
        with pytest.raises(RouteError, match="within 3 hops"):
            best_route("adult", "pepper", line)
        assert best_route("adult", "pepper", line, max_hops=4).hops == 4

    def test_options_of_another_definition_are_refused(self) -> None:
        with pytest.raises(OptionError, match="takes no 'samples'"):
            syda_gym.transferability("adult", "pepper", samples=2**14)
        with pytest.raises(OptionError, match="takes noise as sensor="):
            best_route("adult", "kid", [("adult", "kid")], alpha={frozenset(("adult", "kid")): 0.5})
        with pytest.raises(OptionError, match="has its own definition"):
            best_route("adult", "kid", [("adult", "kid")], "general", predictor="dry_run")

    def test_suggestions_follow_the_same_predictor(self) -> None:
        bodies = ["adult", "kid", "pepper", "stiff"]
        first = suggest(bodies, [("adult", "kid")])
        assert [s.gain for s in first] == sorted((s.gain for s in first), reverse=True)
        tree = spanning_pairs(bodies)
        assert len(tree.pairs) == 3
        hub = max(bodies, key=lambda name: sum(name in pair for pair in tree.pairs))
        assert hub != "stiff"


class TestOnThePaper:
    WAYS = (("adult", "kid", "pepper"), ("kid", "adult", "pepper"))

    @pytest.fixture(scope="class")
    def recorded(self, paper_dir):
        motions = syda_gym.load_motions(f"paper:{paper_dir}")
        return plan_from_motions(motions, "pepper"), motions.bodies

    def test_its_chains_come_in_the_measured_order_and_tie_without_a_sensor(self, recorded) -> None:
        plan, bodies = recorded
        margin, noise = Rehearsal(bodies, plan).margin(*self.WAYS)
        assert margin > noise
        margin, noise = Rehearsal(bodies, plan, sensor={"adult": 0.0, "kid": 0.0}).margin(*self.WAYS)
        assert abs(margin) < noise

    @pytest.mark.parametrize("shift", [-0.005, 0.005])
    def test_their_order_stays_when_the_kids_elbow_moves(self, recorded, shift) -> None:
        plan, bodies = recorded
        kid = bodies["kid"]
        other = kid.spec() | {"upper_arm": kid.upper_arm + shift, "forearm": kid.forearm - shift}
        margin, noise = Rehearsal({**bodies, "kid": catalog.from_spec(other)}, plan).margin(*self.WAYS)
        assert margin > noise


def test_directions_scored_are_landmarks_of_the_body(together, bodies) -> None:
    """The error is that of ``landmark_error`` over the arm's length: checked on the target's own frames."""
    pepper = bodies["pepper"]
    rng = np.random.default_rng(0)
    first, second = (pepper.clamp(rng.uniform(pepper.lower, pepper.upper, (5, pepper.n_features))) for _ in range(2))
    from syda_gym.routes.dry_run.rehearsal import _landmarks

    def limbs(frames):
        return np.diff(pepper.arm_points(frames), axis=2)

    def unit(v):
        return v / np.linalg.norm(v, axis=-1, keepdims=True)

    gap = _landmarks(pepper, unit(limbs(first))) - _landmarks(pepper, unit(limbs(second)))
    mine = np.linalg.norm(gap, axis=-1).reshape(5, -1) * pepper.reach
    assert np.allclose(mine, landmark_error(pepper, first, second), atol=2e-3)
    assert FPS == 15.0
