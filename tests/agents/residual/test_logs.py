"""The log of a resumed training goes on where the checkpoint stands."""

from __future__ import annotations

import csv

from syda_gym.agents.residual.logs import training_logger


def _log(folder, resumed_at, steps, extra=()):
    logger = training_logger(folder, resumed_at)
    for step in steps:
        logger.record("time/total_timesteps", step)
        logger.record("rollout/ep_rew_mean", step / 10)
        for name in extra:
            logger.record(name, 1.0)
        logger.dump(step)
    logger.close()
    with (folder / "progress.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_resumed_training_appends_and_drops_what_it_trains_again(tmp_path):
    assert len(_log(tmp_path, None, [0, 100, 200, 300])) == 4
    rows = _log(tmp_path, 200, [300, 400], extra=["train/loss"])
    assert [row["time/total_timesteps"] for row in rows] == ["0", "100", "200", "300", "400"]
    assert [row["train/loss"] for row in rows] == ["", "", "", "1.0", "1.0"]
    assert rows[1]["rollout/ep_rew_mean"] == "10.0"
    assert len(_log(tmp_path, None, [0])) == 1  # begun anew


def test_a_damaged_log_does_not_stop_a_training(tmp_path):
    (tmp_path / "progress.csv").write_bytes(b"\x00\xff nothing")
    assert [row["time/total_timesteps"] for row in _log(tmp_path, 100, [200])] == ["200"]
