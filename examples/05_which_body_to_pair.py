"""Ask which way to go before recording anything: what each way is expected to miss, and which pair to record next.

    python examples/05_which_body_to_pair.py

The dry run rehearses every link on paper, by the operator's planned motion; no recording of a pair is looked at. The
second part checks its word on an action that no mapping has seen.
"""

from pathlib import Path

import syda_gym
from syda_gym.routes.pictures import graph_png
from syda_gym.routes.routing import BodyGraph
from syda_gym.routes.suggestion import suggest

fitted = [("adult", "kid"), ("kid", "pepper"), ("adult", "nao"), ("nao", "pepper")]
ways = syda_gym.ranked_routes("adult", "pepper", fitted=fitted)
for way in ways:
    print(f"{' > '.join(way.bodies):24} expected {100 * way.error:.1f} cm, give or take {100 * way.standard_error:.1f}")
print("record next:")
for choice in suggest(["adult", "kid", "pepper", "nao"], fitted=fitted)[:2]:
    print(f"  {' and '.join(choice.pair)}: the sum over all best routes rises by {choice.gain:.3f}")

motions = syda_gym.load_motions("embedded", fps=5)
unseen = ["wave_high"]
for way in ways:
    links = [motions.pair(a, b).without_actions(unseen) for a, b in zip(way.bodies[:-1], way.bodies[1:], strict=True)]
    chain = syda_gym.fit(links[0])
    for link in links[1:]:
        chain = chain >> syda_gym.fit(link)
    test = motions.pair("adult", "pepper").only_actions(unseen)
    error = syda_gym.landmark_error(test.target_body, chain(test.source), test.target)
    print(f"{' > '.join(way.bodies):24} measured {100 * error.mean():.1f} cm on {unseen[0]}")

Path("which_body.png").write_bytes(graph_png(BodyGraph(fitted=fitted), ways[0], ties=ways[0].ties))
print("picture: which_body.png")
