"""Names in help texts are those that the library really knows."""

from __future__ import annotations

from syda_gym.agents.classical.rivals import RIVALS
from syda_gym.agents.residual.config import ALGORITHMS, preset_names
from syda_gym.agents.work import shipped_agents
from syda_gym.cli import names
from syda_gym.embodiments import catalog
from syda_gym.envs.task.disturbances import CELLS, LEVELS, PRESETS
from syda_gym.envs.task.options import REFERENCES
from syda_gym.evaluation.data_sets.lerobot_films import CAMERAS
from syda_gym.evaluation.episodes import FIGURES
from syda_gym.mappings.fitting.fit import METHODS
from syda_gym.motions.clip import PROTOCOLS
from syda_gym.motions.loading import FORMATS
from syda_gym.routes.metric import DEFINITIONS
from syda_gym.routes.routing import PREDICTORS
from syda_gym.simulation.backend import BACKENDS
from syda_gym.teleoperation.addresses import SINKS, SOURCES
from syda_gym.teleoperation.calibration import AXES


def kinds(written: tuple[str, ...]) -> set[str]:
    return {text.partition(":")[0].partition("[")[0] for text in written}


def test_bodies_are_those_of_the_catalog(tmp_path, monkeypatch):
    monkeypatch.setenv("SYDA_GYM_HOME", str(tmp_path))
    assert set(names.BODIES) <= set(catalog.names())
    shipped = {name for name in catalog.names() if catalog._makers[name].__module__.startswith("syda_gym.")}
    assert set(names.BODIES) == shipped


def test_methods_and_presets_in_their_order():
    assert {name: tuple(method.presets) for name, method in METHODS.items()} == names.METHODS
    assert [method.default for method in METHODS.values()] == [presets[0] for presets in names.METHODS.values()]


def test_everything_else():
    assert tuple(FORMATS) == names.FORMATS
    assert tuple(CAMERAS) == names.CAMERAS
    assert tuple(CELLS) == names.CELLS
    assert names.LEVELS == LEVELS
    assert tuple(PRESETS) == names.SINGLE_DISTURBANCES
    assert names.PROTOCOLS == PROTOCOLS
    assert names.DEFINITIONS == DEFINITIONS
    assert ("dry_run", *PREDICTORS, "measured") == names.PREDICTORS
    assert tuple(RIVALS) == names.RIVALS
    assert set(shipped_agents()) == set(names.SHIPPED_AGENTS)
    assert set(preset_names()) == set(names.CONFIGS)
    assert names.ALGORITHMS == ALGORITHMS
    assert names.PHYSICS == BACKENDS
    assert names.REFERENCES == REFERENCES
    assert tuple(AXES) == names.AXES
    assert names.FIGURES == FIGURES
    assert kinds(names.SOURCES) == set(SOURCES)
    assert kinds(names.SINKS) == set(SINKS)
