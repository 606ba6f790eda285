"""Fit a mapping on arrays of your own, judge it on unseen actions, save it, and load it again.

    python examples/fit_your_npz.py [FILE.npz]

FILE.npz holds ``adult`` (N, 18), landmark positions in metres; ``pepper`` (N, 10), joint angles in radians; and
``actions`` (N,), the name of what is done in each row. Without an argument such a file is made from the synthetic
motions.
"""

import sys
from pathlib import Path

import numpy as np

import syda_gym

if len(sys.argv) > 1:
    file = Path(sys.argv[1])
else:
    pair = syda_gym.load_motions("embedded", fps=5).pair("adult", "pepper")
    file = Path("my_recordings.npz")
    np.savez_compressed(file, adult=pair.source, pepper=pair.target, actions=pair.actions)

with np.load(file, allow_pickle=False) as arrays:
    pair = syda_gym.PairedMotions(
        syda_gym.embodiment("adult"),
        syda_gym.embodiment("pepper"),
        arrays["adult"],
        arrays["pepper"],
        actions=arrays["actions"],
    )

train, test = next(pair.folds("loao"))  # one action is left out
mapping = syda_gym.fit(train, method="syda", preset="general", seed=0)
error = syda_gym.landmark_error(pair.target_body, mapping(test.source), test.target)
bound = mapping.error_bound(test.source)
print(pair)
print(f"unseen action {test.action_names[0]!r}: {error.mean():.4f} m; predicted bound {bound.mean():.4f} m")

syda_gym.save_mapping(mapping, "adult_to_pepper")  # adult_to_pepper.safetensors and its card adult_to_pepper.json
again = syda_gym.load_mapping("adult_to_pepper")
assert np.array_equal(again(test.source), mapping(test.source))
