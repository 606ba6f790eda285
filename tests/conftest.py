"""Fixtures that every room shares."""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest

# The same examples in every run: a red test means a changed program, not other luck. Search wider with
# `pytest --hypothesis-profile=default`.
hypothesis.settings.register_profile("same-every-time", derandomize=True)
hypothesis.settings.load_profile("same-every-time")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")


# Files that take longest, the longest first: begun last, one of them would keep a single process busy at the end.
LONGEST = (
    "tests/test_docs.py",
    "tests/test_examples.py",
    "tests/evaluation/benchmark/test_benchmark.py",
    "tests/evaluation/report/test_report.py",
    "tests/test_docs_commands.py",
    "tests/agents/test_work.py",
    "tests/envs/parallel/test_parallel.py",
    "tests/test_interrupts.py",
    "tests/evaluation/paper/test_paper.py",
    "tests/test_packaging.py",
    "tests/teleoperation/test_session.py",
    "tests/agents/graphs/test_graphs.py",
    "tests/evaluation/test_episodes.py",
    "tests/files/test_hostile_files.py",
    "tests/teleoperation/bags/test_mcap_journal.py",
    "tests/teleoperation/test_failures.py",
    "tests/envs/test_teleop.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first, the others as they were found."""
    rank = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.nodeid.split("::")[0], len(rank)))


@pytest.fixture(autouse=True)
def catalog_forgets() -> Iterator[None]:
    """Bodies that a test adds to the catalog are gone after it, whichever test comes next in this process."""
    from syda_gym.embodiments import catalog

    before = dict(catalog._makers)
    yield
    if catalog._makers != before:
        catalog._makers.clear()
        catalog._makers.update(before)
        catalog._build.cache_clear()


@pytest.fixture(scope="session")
def shared_dir() -> Path:
    """Folder with recordings and robot facts; they have no licence to be shipped, so it may be absent."""
    default = Path(__file__).resolve().parents[1].parent / "shared"
    folder = Path(os.environ.get("SYDA_GYM_SHARED", default))
    if not folder.is_dir():
        pytest.skip(f"SKIPPED LOUDLY: no folder {folder}; set SYDA_GYM_SHARED to test on real recordings")
    return folder


@pytest.fixture(scope="session")
def paper_dir(shared_dir: Path) -> Path:
    """The paper's recordings."""
    folder = shared_dir / "data" / "paper"
    if not folder.is_dir():
        pytest.skip(f"SKIPPED LOUDLY: no folder {folder}; the paper's recordings are needed")
    return folder


@pytest.fixture(scope="session")
def pose_model(shared_dir: Path) -> Iterator[Path]:
    """The pose model's file, at its default place for the time of the tests; a user downloads it."""
    pytest.importorskip("mediapipe", reason="SKIPPED LOUDLY: the extra 'camera' is not installed")
    file = shared_dir / "models" / "pose_landmarker_full.task"
    if not file.is_file():
        pytest.skip(f"SKIPPED LOUDLY: no pose model {file}; camera and films are not tested")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SYDA_GYM_POSE_MODEL", str(file))
        yield file


@pytest.fixture(scope="session")
def person_film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two seconds of a person who sways: a well-known photograph, turned and moved."""
    data = pytest.importorskip("skimage.data", reason="SKIPPED LOUDLY: scikit-image, which has the photograph")
    cv2 = pytest.importorskip("cv2", reason="SKIPPED LOUDLY: the extra 'camera' is not installed")
    from syda_gym.simulation.pictures.video import write_video

    picture, path = data.astronaut(), tmp_path_factory.mktemp("film") / "person.mp4"

    def pictures() -> Iterator[Any]:
        for step in range(30):
            swing = math.sin(2.0 * math.pi * step / 30)
            turn = cv2.getRotationMatrix2D((256, 256), 12.0 * swing, 0.8)
            turn[0, 2] += 20.0 * swing
            yield cv2.warpAffine(picture, turn, (512, 512))

    return write_video(path, pictures(), 15.0)


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Headless Chromium; a test that needs it is skipped, loudly, where there is none."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="no selenium: browser tests are skipped")
    if CHROMIUM is None or DRIVER is None:
        pytest.skip("no chromium and chromedriver on this machine: pages were not tried in a browser")
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader",
                     "--use-angle=swiftshader", "--window-size=1200,900", "--hide-scrollbars"):  # fmt: skip
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(service=Service(DRIVER), options=options)
    yield driver
    driver.quit()
