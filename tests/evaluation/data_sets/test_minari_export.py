"""Episodes as a Minari data set: what is stored is what was played, and the environment comes back from it."""

from __future__ import annotations

import numpy as np
import pytest

from syda_gym.errors import OptionError, StorageError
from syda_gym.evaluation.data_sets.minari_export import export_minari
from syda_gym.evaluation.data_sets.scene import Scene

NEEDED = "SKIPPED LOUDLY: exporting needs pip install 'syda-gym[data]'"
minari = pytest.importorskip("minari", reason=NEEDED)
pytest.importorskip("jax", reason=NEEDED)  # Minari's recorder needs it

NAME = "syda/adult-pepper-v0"


def test_episodes_are_stored_and_their_environment_is_made_again(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    exported = export_minari(
        NAME, Scene(agent="base", seed=3, command="for a test", options={"physics": "servo"}), episodes=2
    )
    assert exported.path.is_relative_to(tmp_path)
    stored = minari.load_dataset(NAME)
    assert (stored.total_episodes, stored.total_steps) == (exported.episodes, exported.steps)
    for episode in stored.iterate_episodes():
        assert len(episode.observations) == len(episode.actions) + 1
        assert np.abs(episode.actions).max() < 1e-5, "the base alone corrects nothing but its own rounding"
        assert np.isfinite(episode.rewards).all()
    env = stored.recover_environment()
    assert env.unwrapped.options.physics == "servo"
    assert env.observation_space == stored.observation_space
    env.close()
    with pytest.raises(StorageError, match="raise its version"):
        export_minari(NAME, Scene(), episodes=1)


def test_names_and_methods_that_do_not_exist_are_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    with pytest.raises(OptionError, match="try syda/adult-pepper-v0"):
        export_minari("no version", Scene(), episodes=1)
    with pytest.raises(OptionError, match="did you mean 'syda'"):
        export_minari(NAME, Scene(method="sida"), episodes=1)
    assert not minari.list_local_datasets()
