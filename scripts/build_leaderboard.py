"""The leaderboard of the registered ids: formulas, shipped agents, and PPO and SAC from scratch, on actions unseen.

    python scripts/build_leaderboard.py --out leaderboard                  # resumable: finished cells are kept
    python scripts/build_leaderboard.py --out leaderboard --seeds 1 --ids SydaTeleopNoise-v0
    python scripts/build_leaderboard.py --out leaderboard --calibrate        # the family's thresholds, printed

Every id is played as registered, in Bullet. The families of gestures in ``UNSEEN`` are judged, one take of each
action; everything else may be trained on. Classical agents have the settings shipped for the id's disturbances. PPO
and SAC take the id's own observation, action and reward, and the hyper-parameters of ``syda_gym/assets/rl_zoo3``;
they learn in the servo model, in Bullet where contacts count. A cell is computed again when anything that it depends
on has changed.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import syda_gym
from syda_gym.agents.agent import Agent
from syda_gym.agents.figures import episode_figures
from syda_gym.agents.interface import Interface
from syda_gym.agents.learned.policy import ResidualPolicy
from syda_gym.agents.rollout import play_episode
from syda_gym.agents.work import find_agent, shipped_agents
from syda_gym.embodiments.embodiment import FloatArray
from syda_gym.envs.family import FAMILY, Member
from syda_gym.envs.task.options import SUCCESS_ERRORS
from syda_gym.envs.teleop import SydaTeleopEnv
from syda_gym.envs.vector import SydaTeleopVectorEnv
from syda_gym.evaluation.cell_files import CellFiles
from syda_gym.evaluation.statistics import clustered_estimate
from syda_gym.files import asset, atomic_path, fingerprint, write_json, write_text
from syda_gym.locks import locked_folder

UNSEEN = ("cross", "clap", "signal")
"""Families of gestures that nothing on the leaderboard was trained on."""
BUNDLES = {
    "SydaTeleop-v0": "adult-pepper-lag",
    "SydaTeleopNoise-v0": "adult-pepper-noise",
    "SydaTeleopLatency-v0": "adult-pepper-latency",
    "SydaTeleopFull-v0": "adult-pepper-full",
    "SydaTeleopContacts-v0": "adult-pepper-contacts",
}
CLASSICAL = ("base", "lead", "kalman")
TOUCHING = ("projection_lead", "sliding_lead")  # where contacts count
ROWS = (*CLASSICAL, *TOUCHING, "shipped", "predictor", "residual", "ppo", "sac")
LABELS = {
    "base": "base", "lead": "lead", "kalman": "Kalman filter, tuned", "projection_lead": "projection, then lead",
    "sliding_lead": "lead, then sliding", "shipped": "shipped: no network, a filter and a lead",
    "predictor": "predictor, shipped", "residual": "predictor, then residual, shipped",
    "ppo": "PPO from scratch", "sac": "SAC from scratch",
}  # fmt: skip
RESULTS = Path(__file__).resolve().parents[1] / "docs" / "results" / "leaderboard.json"
PAGE = RESULTS.parents[1] / "leaderboard.md"
PICTURE = RESULTS.parents[1] / "images" / "leaderboard.png"
Play = Callable[[SydaTeleopEnv, int, int], dict[str, float]]


def actions(seen: bool) -> list[str]:
    """Training actions, or those that are judged."""
    families = syda_gym.load_motions("embedded").families
    return sorted(action for action, family in families.items() if (family in UNSEEN) != seen)


def random(member: Member) -> bool:
    """Whether a formula's figures depend on the seed."""
    return "disturbances" in member.options


def agent_of(member: Member, row: str, interface: Interface) -> Agent | None:
    """A formula or a shipped agent; ``None`` where the id has none."""
    if row in CLASSICAL or (row in TOUCHING and member.options.get("self_collision")):
        return find_agent(row, interface, member.options.get("disturbances"))
    bundle = BUNDLES.get(member.id)
    if row not in ("shipped", "predictor", "residual") or bundle not in shipped_agents():
        return None
    agent = find_agent(str(bundle), interface)
    if (row == "shipped") == ("predictor" in agent.stack):
        return None
    taught = isinstance(agent, ResidualPolicy)
    if row == "residual":
        return agent if taught else None
    return agent.base if taught else agent


def settings_of(algorithm: str, member: Member) -> dict[str, Any]:
    """Hyper-parameters of the shipped file."""
    content = yaml.safe_load(asset("rl_zoo3", f"{algorithm}.yml").read_text(encoding="utf-8"))
    found: dict[str, Any] = content[member.id]
    return found


def key_of(member: Member, row: str, seed: int, played: Sequence[str]) -> str:
    """Everything that decides a cell."""
    options = {name: value for name, value in member.options.items() if name != "success_error"}  # judged afterwards
    depends: dict[str, Any] = {
        "id": [member.id, options], "row": row, "seed": seed, "actions": list(played),
        "versions": [syda_gym.__version__, np.__version__], "code": _code(),
        "motions": fingerprint(*(path.read_bytes() for path in sorted(asset("motions").glob("*")) if path.is_file())),
    }  # fmt: skip
    if row in ("ppo", "sac"):
        depends["settings"] = settings_of(row, member)
    elif row in ("shipped", "predictor", "residual"):
        files = sorted(asset("agents").glob(f"{BUNDLES.get(member.id)}.*"))
        depends["bundle"] = fingerprint(*(path.read_bytes() for path in files))
    else:
        depends["tuned"] = asset("agents", "tuned", "settings.json").read_text(encoding="utf-8")
    return fingerprint(json.dumps(depends, sort_keys=True, default=str))


def _code() -> str:
    """The rooms that a cell passes through."""
    package = Path(syda_gym.__file__).parent
    rooms = ("agents", "embodiments", "envs/task", "mappings", "motions/readers/own", "simulation")
    files = [path for room in rooms for path in sorted((package / room).rglob("*.py"))]
    return fingerprint(
        *(path.read_bytes() for path in [*files, *(package / "envs" / f for f in ("fleet.py", "solo.py"))])
    )


@lru_cache(maxsize=2)
def environment(place: int, action_mode: str, seen: bool) -> SydaTeleopEnv:
    """The environment of an id of the family, kept for the next row."""
    return SydaTeleopEnv(actions=actions(seen), action_mode=action_mode, **FAMILY[place].options)


def policy_player(model: Any, member: Member, calibrate: bool) -> tuple[SydaTeleopEnv, Play]:
    """An environment and a player for a policy of Stable-Baselines3."""
    env = environment(FAMILY.index(member), "residual", calibrate)

    def play(env: SydaTeleopEnv, clip: int, seed: int) -> dict[str, float]:
        observation, info = env.reset(seed=seed, options={"motion": clip})
        rows, reward, done = [], 0.0, False
        while not done:
            action = model.predict(observation, deterministic=True)[0]
            observation, gained, terminated, truncated, info = env.step(action)
            rows.append((info["q"], info["reference"], info["contacts"], info["landmark_error"].mean()))
            reward += float(gained)
            done = terminated or truncated
        q, reference, contacts, errors = (np.array(column) for column in zip(*rows, strict=True))
        return _told(env, q, reference, contacts, errors, reward)

    return env, play


def agent_player(agent: Agent, member: Member, calibrate: bool) -> tuple[SydaTeleopEnv, Play]:
    """The same for an agent, which gives commands."""
    env = environment(FAMILY.index(member), "position", calibrate)

    def play(env: SydaTeleopEnv, clip: int, seed: int) -> dict[str, float]:
        found = play_episode(env, agent, clip, seed=seed)
        errors = np.linalg.norm(env.robot.landmarks(found.q) - env.robot.landmarks(found.reference), axis=-1)
        return _told(env, found.q, found.reference, found.contacts, errors.mean(axis=1), found.reward)

    return env, play


def _told(
    env: SydaTeleopEnv, q: FloatArray, reference: FloatArray, contacts: FloatArray, errors: FloatArray, reward: float
) -> dict[str, float]:
    figures = episode_figures(env.robot, q, reference, contacts).as_dict()
    return {**figures, "return": reward, "error_m": float(errors.mean())}


def judged(env: SydaTeleopEnv, play: Play, seed: int) -> list[dict[str, Any]]:
    """One episode of each action: its first take."""
    episodes, done = [], set()
    for clip, action in enumerate(env.clip_actions):
        if action not in done:
            done.add(action)
            drawn = int(np.random.SeedSequence([seed, clip]).generate_state(1)[0])
            episodes.append({"action": action, **play(env, clip, drawn)})
    return episodes


def train(algorithm: str, member: Member, seed: int) -> tuple[Any, list[list[float]]]:
    """A model of Stable-Baselines3, and its curve: steps, mean return of the episodes that ended lately."""
    import stable_baselines3
    import torch
    from stable_baselines3.common.callbacks import BaseCallback

    from syda_gym.envs.sb3 import TeleopVecEnv

    torch.set_num_threads(1)
    settings = settings_of(algorithm, member)
    count, steps = int(settings.pop("n_envs")), int(float(settings.pop("n_timesteps")))
    env = SydaTeleopVectorEnv(
        count, autoreset_mode="same_step", actions=actions(True), **{**member.options, **settings.pop("env_kwargs")}
    )
    curve: list[list[float]] = []

    class Curve(BaseCallback):  # type: ignore[misc]
        def _on_step(self) -> bool:
            lately = self.model.ep_info_buffer
            if lately and (not curve or self.num_timesteps >= curve[-1][0] + steps / 20):
                curve.append([self.num_timesteps, float(np.mean([episode["r"] for episode in lately]))])
            return True

    kind = getattr(stable_baselines3, algorithm.upper())
    model = kind(settings.pop("policy"), TeleopVecEnv(env), seed=seed, device="cpu", **settings)
    model.learn(steps, callback=Curve())
    env.close()
    return model, curve


def compute(member: Member, row: str, seed: int, calibrate: bool) -> dict[str, Any] | None:
    """One cell; ``None`` where the id has no such row."""
    start, curve = time.process_time(), []
    if row in ("ppo", "sac"):
        model, curve = train(row, member, seed)
        episodes = judged(*policy_player(model, member, calibrate), seed)
    else:
        agent = agent_of(member, row, Interface.of(environment(FAMILY.index(member), "position", calibrate)))
        if agent is None:
            return None
        episodes = judged(*agent_player(agent, member, calibrate), seed)
    return {"episodes": episodes, "curve": curve, "cpu_seconds": round(time.process_time() - start, 1)}


def run(out: Path, ids: Sequence[str], rows: Sequence[str], seeds: int, calibrate: bool) -> dict[str, Any]:
    """Computes the cells that are asked for and are missing; returns all that there are, by id and row."""
    found: dict[str, Any] = {}
    with locked_folder(out, "leaderboard") as folder:
        files = CellFiles(folder / "cells")
        played = actions(calibrate)
        for member in FAMILY:
            for row in CLASSICAL if calibrate else ROWS:
                for seed in range(seeds):
                    if seed and row not in ("ppo", "sac") and not random(member):
                        continue
                    name = f"{member.id}-{row}-{seed}{'-calibrate' if calibrate else ''}"
                    key = key_of(member, row, seed, played)
                    cell = files.read(name, key)
                    if cell is None and (row not in rows or member.id not in ids):
                        break
                    if cell is None:
                        cell = compute(member, row, seed, calibrate)
                        if cell is None:
                            break
                        files.write(name, key, cell)
                        print(f"{name}: J {_mean(cell, 'J'):.2f}, {cell['cpu_seconds']} s", flush=True)
                    found.setdefault(member.id, {}).setdefault(row, []).append(cell)
    return found


def _mean(cell: dict[str, Any], figure: str) -> float:
    return float(np.mean([episode[figure] for episode in cell["episodes"]]))


def thresholds(found: dict[str, Any]) -> dict[str, Any]:
    """The two measured numbers of every id."""
    told = {}
    for name, rows in found.items():
        returns = {row: float(np.mean([_mean(cell, "return") for cell in cells])) for row, cells in rows.items()}
        errors = [episode["error_m"] for cell in rows["base"] for episode in cell["episodes"]]
        best = max(returns, key=lambda row: returns[row])
        told[name] = {
            "success_error": round(float(np.median(errors)), 3),
            "reward_threshold": round(returns[best], 1),
            "best": best,
            "returns": {row: round(value, 2) for row, value in returns.items()},
        }
    return told


def summary(found: dict[str, Any]) -> dict[str, Any]:
    """Means with intervals over actions, and the mean curve, by id and row."""
    told: dict[str, Any] = {}
    for name, rows in found.items():
        options = next(member.options for member in FAMILY if member.id == name)
        allowed = options.get("success_error", SUCCESS_ERRORS["paired"])
        for row, cells in rows.items():
            episodes = [
                {**episode, "success": float(episode["error_m"] <= allowed)}
                for cell in cells
                for episode in cell["episodes"]
            ]
            clusters = [episode["action"] for episode in episodes]
            entry: dict[str, Any] = {"seeds": len(cells), "episodes": len(episodes)}
            for figure in ("J", "landmark_mm", "jitter", "return", "success", "contact_steps"):
                values = clustered_estimate([e[figure] for e in episodes], clusters, statistic=np.mean)
                entry[figure] = [round(values.value, 3), round(values.low, 3), round(values.high, 3)]
            entry["curve"] = _curve(cells)
            entry["cpu_seconds"] = round(sum(cell["cpu_seconds"] for cell in cells), 1)
            told.setdefault(name, {})[row] = entry
    return told


def _curve(cells: Sequence[dict[str, Any]]) -> list[list[float]]:
    """The mean over seeds at the same steps."""
    grid = np.array(min((cell["curve"] for cell in cells), key=len)).reshape(-1, 2)[:, 0]
    curves = [np.interp(grid, *np.array(cell["curve"]).T) for cell in cells if len(grid)]
    return (
        [[step, round(float(value), 2)] for step, value in zip(grid.tolist(), np.mean(curves, axis=0), strict=True)]
        if curves
        else []
    )


def page(result: dict[str, Any]) -> str:
    """The page of the documentation."""
    lines = [
        "# Leaderboard", "",
        "Every registered id as it is, in Bullet, on gestures that nothing here was trained on (families "
        f"{', '.join(UNSEEN)}; ten", "actions). J is landmark error [mm] + 0.05 x joint error [mrad] + jitter "
        "[mm/frame³]; less is better. Return is the sum of", "the environment's rewards, success the share of episodes "
        "within the id's `success_error`. Means with 95 % intervals over", "actions; disturbances and networks are "
        "drawn anew for each seed; where nothing is disturbed, a formula is the same for every seed.", "",
        "PPO and SAC learn from scratch with the id's own observation, action and reward, and the hyper-parameters "
        "that come with", "the package (`syda_gym/assets/rl_zoo3`): a minute's budget, no history, no preview. "
        "Shipped agents were trained on generated", "motions of other families; which of them is shipped was decided "
        "on the package's motions, too.", "", "```console",
        "python scripts/build_leaderboard.py --out leaderboard", "```", "",
    ]  # fmt: skip
    for member in FAMILY:
        rows = result["table"].get(member.id, {})
        if not rows:
            continue
        touch = bool(member.options.get("self_collision"))
        options = ", ".join(f"`{name}={value!r}`" for name, value in member.options.items()) or "the defaults"
        best = min(rows, key=lambda row: rows[row]["J"][0])
        lines += [
            f"## `{member.id}`: {member.about}",
            "",
            f"Options: {options}. Threshold: {member.reward_threshold}.",
            "",
        ]
        lines.append(f"<!-- numbers: docs/results/{RESULTS.name} -->\n")
        lines.append(
            "| agent | seeds | J | landmark error [mm] | jitter | return | success |"
            + (" contact steps |" if touch else "")
        )
        lines.append("|---|---|---|---|---|---|---|" + ("---|" if touch else ""))
        for row, entry in rows.items():
            cells = [LABELS[row], str(entry["seeds"]), _three(entry["J"], 1), f"{entry['landmark_mm'][0]:.1f}"]
            cells += [f"{entry['jitter'][0]:.2f}", _three(entry["return"], 1), f"{100 * entry['success'][0]:.0f} %"]
            cells += [f"{100 * entry['contact_steps'][0]:.1f} %"] if touch else []
            lines.append("| " + " | ".join(f"**{cell}**" if row == best else cell for cell in cells) + " |")
        lines.append("")
    lines += [
        "## Learning", "",
        "Mean return of the training episodes, exploration included, in the servo model (Bullet for contacts); the",
        "first points are of the shortest clips, which end first. Grey lines are base and best formula on the first",
        "takes of the same actions, in Bullet.", "",
        "![Returns of PPO and SAC while they learn](images/leaderboard.png)", "",
    ]  # fmt: skip
    return "\n".join(lines)


def _three(values: Sequence[float], digits: int) -> str:
    value, low, high = (f"{number:.{digits}f}" for number in values)
    return f"{value} ({low} to {high})"


def picture(result: dict[str, Any]) -> None:
    """Learning curves beside the base."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    from syda_gym.look import OPERATOR, ROBOT

    names = [member.id for member in FAMILY if member.id in result["table"]]
    figure, axes = pyplot.subplots(2, -(-len(names) // 2), figsize=(11, 5.5), squeeze=False, layout="constrained")
    for axis in axes.flat[len(names) :]:
        axis.remove()
    for axis, name in zip(axes.flat, names, strict=False):
        for row, colour in (("ppo", ROBOT), ("sac", OPERATOR)):
            curve = result["table"][name].get(row, {}).get("curve")
            if curve:
                steps, returns = np.array(curve).T
                axis.plot(steps / 1000.0, returns, color=colour, label=row.upper())
        told = result["thresholds"].get(name, {}).get("returns", {})
        for row in dict.fromkeys(("base", result["thresholds"].get(name, {}).get("best", "base"))):
            if row in told:
                axis.axhline(told[row], color="0.45", linestyle=":" if row == "base" else "-", linewidth=1.2, label=row)
        axis.set_title(name, fontsize=10)
        axis.set_xlabel("thousand steps")
        axis.set_ylabel("return")
        axis.legend(fontsize=8, frameon=False)
        axis.spines[["top", "right"]].set_visible(False)
    with atomic_path(PICTURE) as path:
        figure.savefig(path, dpi=110)
    pyplot.close(figure)


def main() -> None:
    """Computes what is missing and writes results, page and picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    names = [member.id for member in FAMILY]
    parser.add_argument("--out", type=Path, required=True, help="folder of the finished cells")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--ids", nargs="+", choices=names, default=names)
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS), help="compute these; show what there is")
    parser.add_argument("--calibrate", action="store_true", help="only measure the family's thresholds")
    given = parser.parse_args()
    calibrated = thresholds(run(given.out, given.ids, CLASSICAL, 1, True))
    print(json.dumps(calibrated, indent=1))
    if given.calibrate:
        return
    result = {"thresholds": calibrated, "table": summary(run(given.out, given.ids, given.rows, given.seeds, False))}
    write_json(RESULTS, result)
    write_text(PAGE, page(result))
    picture(result)


if __name__ == "__main__":
    main()
