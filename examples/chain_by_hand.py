"""Chain two mappings by hand and compare the chain with a direct pair, on an action that neither has seen.

python examples/chain_by_hand.py
"""

import syda_gym

motions = syda_gym.load_motions("embedded", fps=5)  # synthetic; "paper:DIR" for the paper's recordings
unseen = [motions.pair("adult", "pepper").action_names[0]]


def fit(source: str, target: str) -> syda_gym.Mapping:
    """Fits a pair without the unseen action."""
    return syda_gym.fit(motions.pair(source, target).without_actions(unseen), seed=0)


chain = fit("adult", "kid") >> fit("kid", "pepper")
test = motions.pair("adult", "pepper").only_actions(unseen)
for name, mapping in (("adult > kid > pepper", chain), ("adult > pepper", fit("adult", "pepper"))):
    error = syda_gym.landmark_error(test.target_body, mapping(test.source), test.target)
    print(f"{name:22} {error.mean():.4f} m on {unseen[0]!r}")
