"""The commands that say which way to go: ``transferability`` and ``route``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from syda_gym.cli import checks
from syda_gym.cli.groups.reading import Reading, with_reading
from syda_gym.cli.names import PREDICTORS, ticked
from syda_gym.cli.options import (
    BodiesArgument,
    CountOption,
    DefinitionOption,
    JsonOption,
    MaxHopsOption,
    MotionsOption,
    OperatorOption,
    PairOption,
    PictureOption,
    RobotOption,
    SeedOption,
    SensorOption,
    ends_of,
    pairs_of,
    sensors_of,
)
from syda_gym.cli.shared import interruptible, print_json, print_table, stages

if TYPE_CHECKING:
    from syda_gym.motions import Motions

__all__ = ["route", "transferability"]


@with_reading
def transferability(
    bodies: BodiesArgument = None,
    definition: DefinitionOption = "dry_run",
    validate: Annotated[bool, typer.Option("--validate", help="Measure whether it predicts held-out errors.")] = False,
    motions: MotionsOption = "embedded",
    sensor: SensorOption = None,
    folds: Annotated[int, typer.Option("--folds", help="Groups of actions to hold out (`--validate`).", min=2)] = 4,
    max_hops: MaxHopsOption = None,
    picture: PictureOption = None,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
    *,
    reading: Reading,
) -> None:
    """Estimate how well each body can follow each other one, before anything is recorded.

    The dry run plans the synthetic motions that come along, and those of `--motions` beside them, and leads robots in
    both common ways: limbs pointed, hands led to positions. The picture shows workspaces of the first pair; with
    `--validate` estimates beside measured errors.
    """
    from itertools import permutations

    from syda_gym.embodiments import catalog
    from syda_gym.evaluation.prediction.tables import links_table, prediction_table
    from syda_gym.files import write_bytes
    from syda_gym.routes.metric import transferability as measure

    recorded = reading.read(motions)
    if validate:
        from syda_gym.evaluation.prediction.study import validate as measure_prediction

        words = {"fit": "Fitting every pair and fold", "chains": "Scoring every chain"}
        with interruptible("nothing was kept; run the command again"), stages(words) as tell:
            study = measure_prediction(
                recorded, bodies=bodies or None, folds=folds, max_hops=max_hops or 3, seed=seed, progress=tell
            )
        tables = [prediction_table(study), *([prediction_table(study, full=True)] if study.full_scores else [])]
        if picture:
            from syda_gym.evaluation.prediction.picture import prediction_png

            write_bytes(picture, prediction_png(study))
        if as_json:
            print_json(study.as_dict())
        for table in () if as_json else tables:
            print_table(table)
        return
    names = list(bodies or ("adult", "kid", "pepper", "nao"))
    chosen = [
        catalog.resolve(name) for name in (names if len(names) > 1 else [*names, "adult", "kid", "pepper", "nao"])
    ]
    distinct = list({body.name: body for body in chosen}.values())
    pairs = list(permutations(distinct, 2))
    if len(names) == 1:  # one body: how it leads and follows the others
        pairs = [(a, b) for a, b in pairs if distinct[0] in (a, b)]
    kind: Any = definition  # checked, with the nearest name, where it is used
    options = _plan_of(recorded, sensor) if kind == "dry_run" else {}
    links = [measure(a, b, kind, seed=seed, **options) for a, b in pairs]
    if picture:
        from syda_gym.routes.pictures import clouds_png

        write_bytes(picture, clouds_png(*pairs[0], "paper" if kind == "paper" else "general", seed=seed))
    print_json([link.as_dict() for link in links]) if as_json else print_table(links_table(links))


@with_reading
def route(
    operator: OperatorOption = None,
    robot: RobotOption = None,
    pairs: PairOption = None,
    motions: MotionsOption = "embedded",
    definition: DefinitionOption = None,
    sensor: SensorOption = None,
    max_hops: MaxHopsOption = None,
    predictor: Annotated[
        str | None,
        typer.Option(
            "--predictor", help=f"What decides: {ticked(PREDICTORS)}.", callback=checks.one_of(PREDICTORS, "predictor")
        ),
    ] = None,
    count: CountOption = 5,
    noise: Annotated[bool, typer.Option("--noise", help="Take the noise of sensors from the recordings.")] = False,
    suggest: Annotated[bool, typer.Option("--suggest", help="Also say which pair to record next.")] = False,
    picture: PictureOption = None,
    as_json: JsonOption = False,
    *,
    reading: Reading,
) -> None:
    """Choose the chain of bodies from operator to robot that is expected to do best.

    Fitted pairs are those of `--pair`, by default all that were recorded together in the motions.
    """
    from syda_gym.embodiments import catalog
    from syda_gym.evaluation.prediction.tables import routes_table, suggestions_table
    from syda_gym.files import write_bytes
    from syda_gym.routes import routing, suggestion

    kind: Any = definition  # checked, with the nearest name, where it is used
    source, target = ends_of(operator, robot)
    recorded = reading.read(motions)
    fitted, bodies = _fitted_pairs(pairs_of(pairs), recorded)
    options: dict[str, Any] = {"predictor": predictor}
    if predictor in (None, "dry_run") and kind in (None, "dry_run"):
        options |= _plan_of(recorded, sensor)
        if noise:
            options["sensor"] = {**_seen_noise(recorded, fitted), **(options["sensor"] or {})}
    elif noise:
        from syda_gym.evaluation.prediction.study import motion_noise
        from syda_gym.motions.loading import load_motions
        from syda_gym.routes.noise import alpha_from_noise

        options["alpha"] = alpha_from_noise(motion_noise(load_motions(recorded)))
    if predictor == "measured":
        from syda_gym.routes.measured import measure_bodies

        named = [(getattr(a, "name", a), getattr(b, "name", b)) for a, b in fitted]
        with stages({"fit": "Fitting pairs to measure bodies"}) as tell:
            options["predictor"] = measure_bodies(recorded, named, progress=tell)
    known = {getattr(body, "name", body) for pair in fitted for body in pair}
    for name in (source, target):
        if name not in known:
            catalog.resolve(name)  # a body that nobody knows is told as such, not as one without a fitted pair
    best = routing.best_route(source, target, fitted, kind, max_hops=max_hops, **options)
    ranked = routing.ranked_routes(source, target, fitted, kind, count=count, max_hops=max_hops, **options)
    routes = [best, *(other for other in ranked if other.bodies != best.bodies)][:count]
    further, spanning = None, None
    if suggest:
        further = suggestion.suggest(bodies, fitted, kind, max_hops=max_hops, **options)[:count]
        spanning = suggestion.spanning_pairs(bodies, (), kind, **options)
    if picture:
        from syda_gym.routes.pictures import graph_png

        graph = routing.BodyGraph((), fitted, kind, **options)
        write_bytes(picture, graph_png(graph, best))
    if as_json:
        print_json({
            "routes": [item.as_dict() for item in routes],
            "suggestions": [{"pair": s.pair, "gain": s.gain, "sum": s.total} for s in further or ()],
            "spanning": spanning.pairs if spanning else [],
        })  # fmt: skip
        return
    print_table(routes_table(routes, predictor or "T"))
    if further is not None:
        print_table(suggestions_table(further, spanning))


def _plan_of(motions: str | Motions, sensor: list[str] | None) -> dict[str, Any]:
    """Options of the dry run: the user's motions beside those that come along, and the noise of sensors."""
    return {"motions": None if motions == "embedded" else motions, "sensor": sensors_of(sensor)}


def _seen_noise(motions: str | Motions, fitted: list[tuple[Any, Any]]) -> dict[str, float]:
    """What the recordings say about the sensors of the bodies in question [m]."""
    from syda_gym.motions.loading import load_motions
    from syda_gym.routes.noise import sensor_noise

    recorded = load_motions(motions)
    names = dict.fromkeys(getattr(body, "name", body) for pair in fitted for body in pair)
    return sensor_noise(recorded, [name for name in names if name in recorded.bodies])


def _fitted_pairs(pairs: list[tuple[str, str]], motions: str | Motions) -> tuple[list[tuple[Any, Any]], list[Any]]:
    """Pairs as the user named them, or all that were recorded together; and everybody who can be paired."""
    from syda_gym.motions.loading import load_motions

    if pairs:
        return list(pairs), list(dict.fromkeys(name for pair in pairs for name in pair))
    recorded = load_motions(motions)
    fitted = [(recorded.bodies[a], recorded.bodies[b]) for a, b in recorded.pairs]
    return fitted, list(recorded.bodies.values())
