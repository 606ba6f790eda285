"""Recordings of yourself become a mapping of your own, with what each further action gained.

    python examples/04_record_and_fit.py [RECORDING]

RECORDING is a folder that `syda-gym record` wrote: the robot plays, you mimic it. Without one, four actions of the
synthetic adult and Pepper stand in for it, and this says so.
"""

import sys

import syda_gym
from syda_gym.motions import write_dataset
from syda_gym.routes.piloting.own import fit_own

if len(sys.argv) > 1:
    recording = sys.argv[1]
else:
    print("no recording was named, so four synthetic actions stand in for yours")
    shipped = syda_gym.load_motions("embedded", fps=10)
    actions = ("wave_high", "reach_high_front", "clap", "drum")
    takes = tuple(take for take in shipped.takes if take.action in actions)
    few = syda_gym.Motions("stand-in", takes, shipped.bodies, shipped.families, synthetic=True)
    recording = write_dataset(few, "recording")

done = fit_own([recording], ends=("adult", "pepper"))  # saved where `teleop`, `play` and gym.make look for it
print("recorded actions   error on unseen ones [m]")
for row in done.judged.rows:
    print(f"{row.actions or 'none, unfitted':>16}   {row.error:.4f}")
print(done.judged.advice)
print(f"saved: {done.path}")
