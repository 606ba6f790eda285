"""Ask which way to go before recording anything: transferability of pairs, the best route, the pair to record next.

python examples/choose_a_route.py
"""

import syda_gym
from syda_gym.routes.routing import ranked_routes
from syda_gym.routes.suggestion import suggest

print("from > to          C (capability)   L (reach)   T")
for source, target in (("adult", "kid"), ("kid", "pepper"), ("adult", "pepper"), ("adult", "nao"), ("pepper", "nao")):
    measured = syda_gym.transferability(source, target)
    print(f"{source:>7} > {target:<7}  {measured.C:12.3f} {measured.L:12.3f} {measured.T:9.3f}")

fitted = [("adult", "kid"), ("kid", "pepper"), ("adult", "tall"), ("tall", "pepper")]
for route in ranked_routes("adult", "pepper", fitted=fitted):
    print(f"{' > '.join(route.bodies):24} T = {route.T:.3f}")
print("record next:")
for suggestion in suggest(["adult", "kid", "tall", "pepper", "nao"], fitted=fitted)[:3]:
    print(f"  {suggestion.pair[0]} and {suggestion.pair[1]}: the sum of best routes rises by {suggestion.gain:.3f}")
