"""Episodes as a LeRobotDataset v3.0: joint states, commands, operator, films, statistics and tasks.

    python examples/10_export_to_lerobot.py [FOLDER [EPISODES]]

Needs `pip install 'syda-gym[data]'`. LeRobot itself, in an environment of its own, reads it with
`LeRobotDataset("me/pepper", root=FOLDER)`. The same on the command line, every clip and a second camera; note the
quotes, since a shell takes a bare `>` for itself:

    syda-gym export-episodes FOLDER --format lerobot --route 'adult>kid>pepper' --camera front --camera scene
"""

import sys

import pyarrow.parquet as pq

from syda_gym.evaluation.data_sets.lerobot_export import export_lerobot
from syda_gym.evaluation.data_sets.scene import Scene

folder = sys.argv[1] if len(sys.argv) > 1 else "pepper_episodes"
episodes = int(sys.argv[2]) if len(sys.argv) > 2 else 4
scene = Scene(route="adult>pepper", agent="kalman", disturbance="teleop:noise:test", seed=0)
stored = export_lerobot(folder, scene, episodes=episodes, cameras=["front"])

rows = pq.read_table(stored.path / "data" / "chunk-000" / "file-000.parquet")
print(f"{stored.episodes} episodes, {stored.steps} rows of {', '.join(rows.column_names)}")
print("mean reward", round(sum(rows["next.reward"].to_pylist()) / rows.num_rows, 3))
print(f"film: {stored.path / 'videos' / 'observation.images.front' / 'chunk-000' / 'file-000.mp4'}")
