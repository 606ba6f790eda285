"""The study of unknown dynamics: a policy that reads its history, beside rivals that are tuned for it, judged in Bullet.

    python scripts/study_dynamics.py --out study-dynamics --seeds 5                 # finished parts are kept
    python scripts/study_dynamics.py --out study-dynamics --seeds 5 --stages tune   # one part

Motors at 65 to 100 % of their gain and speed, up to 0.6 kg in each hand and friction that eats up to half of the effort
are drawn anew for every episode and change within it (``disturbances="dynamics"``); nobody is told.

1. `tune`: lead, Kalman filter with lead and adaptive lead, on training motions: many settings in the servo model, the
   best few of them once more in Bullet, where the best is chosen.
2. `predict`: a predictor per seed, by regression through the motors as each episode has them.
3. `policy`: PPO per seed, with the last base commands and joint angles in its observation. What it stands on is chosen
   on validation motions in Bullet, among the tuned rivals and the predictor; so is which of its settings are taken.
4. `test`: once, in Bullet, on gesture families that neither training nor selection saw, several draws a motion.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from syda_gym.agents.agent import Agent
from syda_gym.agents.bundle import load_agent, save_agent
from syda_gym.agents.classical.rivals import RIVALS, Range, make_rival
from syda_gym.agents.figures import Figures
from syda_gym.agents.interface import Interface
from syda_gym.agents.predictor.predictor_training import PredictorConfig, train_predictor
from syda_gym.agents.residual.config import ResidualConfig
from syda_gym.agents.residual.residual_training import train_on_streams
from syda_gym.agents.rollout import EpisodeResult, evaluate, mean_of
from syda_gym.agents.streams.ground import Ground
from syda_gym.agents.streams.streams import score_streams
from syda_gym.envs.task.options import TeleopOptions
from syda_gym.evaluation.statistics import bootstrap_interval
from syda_gym.files import asset, read_json, write_json
from syda_gym.mappings.storage import load_mapping
from syda_gym.motions.synthetic.generator import generate

TRAIN = ("reach", "point", "lift", "push", "work", "circle")
VALIDATION = ("swing", "bow", "wave")
TEST = ("cross", "clap", "signal")
STAGES = ("tune", "predict", "policy", "test", "report")
RANGES = {
    "lead": {"strength": Range(0.0, 2.0)},
    "kalman": {**RIVALS["kalman"].ranges, "strength": Range(0.0, 2.0)},
    "adaptive_lead": RIVALS["adaptive_lead"].ranges,
}
HISTORY = 4
VARIANTS = 4
EPISODES = 160
DRAWS = 3
FINALISTS = 3
