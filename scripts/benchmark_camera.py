"""Measures the way from a film's pictures to commands by part, in processor time, and what the page adds to a tick.

    python scripts/benchmark_camera.py FILM.mp4 [--model pose_landmarker_full.task] [--pictures 150] [--out FILE.json]

Processor time does not depend on what else runs on the machine; pictures a second are those that one core manages when
it does nothing else.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from syda_gym.embodiments import catalog
from syda_gym.files import write_text
from syda_gym.mappings.methods.unfitted import unfitted
from syda_gym.motions import load_motions
from syda_gym.motions.film.landmarks import HiddenJoints, arm_frame
from syda_gym.motions.film.pictures import FilmPictures
from syda_gym.motions.film.pose_model import PoseModel
from syda_gym.teleoperation import LoopSettings, MemorySink, ReplaySource, TeleoperationLoop, Tick
from syda_gym.teleoperation.live_statistics import LiveStatistics
from syda_gym.teleoperation.view.cockpit import Cockpit


def main() -> None:
    """Plays the film as fast as it goes through pose model and loop, and prints medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("film", type=Path)
    parser.add_argument("--model", type=Path)
    parser.add_argument("--pictures", type=int, default=150)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    result = measure(given.film, given.model, given.pictures)
    for name, value in result.items():
        print(f"{name:<32} {value:8.3f}")
    if given.out is not None:
        write_text(given.out, json.dumps(result, indent=1) + "\n")


def measure(film: Path, model: Path | None, pictures: int) -> dict[str, float]:
    """Milliseconds of processor time a picture, by part.

    Args:
        film: of a person.
        model: of the pose; ``None`` for the default place.
        pictures: how many are looked at; the film begins again at its end.
    """
    adult, pepper = catalog.get("adult"), catalog.get("pepper")
    loop = TeleoperationLoop(unfitted(adult, pepper), LoopSettings(calibration=0.0))
    clip = load_motions("embedded").clips("adult")[0]
    cockpit = Cockpit(loop, ReplaySource([clip]), MemorySink(), LiveStatistics())
    hold, parts, seen = HiddenJoints(), [], 0
    with PoseModel(model) as see:
        shots = FilmPictures(film)
        for number in range(pictures):
            shot = shots.read()
            if shot is None:
                shots.close()
                shots = FilmPictures(film)
                shot = shots.read()
            if shot is None:
                raise SystemExit(f"{film} has no pictures")
            now = number / shots.fps
            marks = [time.process_time()]
            pose = see(shot.picture, now)
            marks.append(time.process_time())
            loop.rehearse()  # as the live loop does shortly before a frame is due
            # What follows runs in this thread alone; the model's own threads may still be winding down.
            marks.append(time.thread_time())
            held = None if pose is None else hold(*arm_frame(pose), now)
            marks.append(time.thread_time())
            if held is None:
                continue
            seen += 1
            decision = loop.step(Tick(now, held[0], now, held[1]))
            marks.append(time.thread_time())
            cockpit.update(decision)
            marks.append(time.thread_time())
            loop.settle()  # and this once the command is out
            parts.append(np.delete(np.diff(marks), 1))
        shots.close()
    table = 1e3 * np.array(parts)
    result = {"pictures": float(pictures), "with_a_person": float(seen)}
    for name, column in zip(("pose_model", "joints", "loop", "view"), table.T, strict=True):
        result[f"{name}_ms_median"] = float(np.median(column))
        result[f"{name}_ms_p99"] = float(np.percentile(column, 99))
    result["pictures_a_second_on_one_core"] = 1e3 / float(table.sum(axis=1).mean())
    return result


if __name__ == "__main__":
    main()
