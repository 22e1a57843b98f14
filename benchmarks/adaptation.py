"""Which side of a network adapts to a curl field, and which resists a pulse: trainings, tests and statistics by seed.

    python benchmarks/adaptation.py OUT --models cc_s cc_ns --seeds 5

Networks learn the center-out task by BPTT, and adapt to ``curl_field`` as a whole, with one side and what both share
frozen, and the other way round. Nothing is retrained after a lesion. What is there already is not done again.
``blocks.csv``, ``lesions.csv`` and ``pulses.csv`` have a row a seed, ``verdicts.csv`` one a comparison, with the mean
difference, its 95 % interval by Student's t of the pairs, and p by Holm's procedure within a family.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import bilateral_rl as brl
from bilateral_rl.analysis.block_table import in_conditions
from bilateral_rl.analysis.intervals import difference_interval
from bilateral_rl.analysis.metrics import find_metric, measure
from bilateral_rl.analysis.specialization import ALONE
from bilateral_rl.analysis.statistics import holm, paired_test
from bilateral_rl.analysis.trial_records import TrialRecord
from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import TrainConfig
from bilateral_rl.envs.experiments.experiment import Experiment
from bilateral_rl.envs.experiments.task import ExperimentTask
from bilateral_rl.policies import MotorPolicy
from bilateral_rl.training.fresh_networks import fresh_network

BASE = {"epochs": 40, "bptt.learning_rate": 0.003, "bptt.patience": 40, "threads": 1}
"""How the center-out task is learned."""
FROZEN = {"all": [], "dominant": ["non_dominant", "shared"], "non_dominant": ["dominant", "shared"]}
"""What is frozen, by what adapts."""
METRICS = (
    "goal_completion_2cm", "final_error", "perpendicular_deviation", "signed_deviation", "deviation_at_peak_speed",
    "channel_compensation", "peak_speed",
)  # fmt: skip
STATES = {"intact": "intact", **{f"{side}_alone": lesion for side, lesion in ALONE.items()}}
TRIALS, SEED = 64, 2_000_000


class Played:
    """A policy that plays commands of a time before, whatever it sees; or none at all.

    Args:
        commands: (n, T, 6), in each step of each trial.
    """

    def __init__(self, commands: NDArray[np.float32]) -> None:
        self._commands = iter(commands.swapaxes(0, 1))

    def predict(
        self, observation: object, state: object = None, episode_start: object = None, deterministic: bool = False
    ) -> tuple[NDArray[np.float32], None]:
        """Return the commands of the next step."""
        return next(self._commands), None


def main() -> None:
    """Do what is asked for on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--models", nargs="+", default=["cc_s", "cc_ns"])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    asked = parser.parse_args()
    blocks, lesions, pulses = [], [], []
    for model in asked.models:
        base = trained(asked.out / "base", model, asked, settings=BASE, task="center_out")
        adapted = {
            who: trained(
                asked.out / f"adapted_{who}", model, asked, task="curl_field", init_from=base,
                settings={"frozen": frozen, "threads": 1},
            )
            for who, frozen in FROZEN.items()
        }  # fmt: skip
        blocks += [run.blocks().assign(adapting=who) for who, run in adapted.items()]
        for seed in base.seeds:
            networks = {"before": base.policy(seed), "after": adapted["all"].policy(seed)}
            networks["fresh"] = fresh(base, seed)
            lesions += [row | {"model": model, "seed": seed} for row in lesioned(networks, adapted["all"].config)]
            pulses += [row | {"model": model, "seed": seed} for row in pushed(networks, base.config)]
    tables = {"blocks": pd.concat(blocks), "lesions": pd.DataFrame(lesions), "pulses": pd.DataFrame(pulses)}
    tables["verdicts"] = verdicts(**tables)
    for name, table in tables.items():
        # Readers of CSV take the word null for a value that is missing.
        table.replace("null", "null_field").to_csv(asked.out / f"{name}.csv", index=False, float_format="%.6g")
    print(tables["verdicts"].to_string())


def trained(out: Path, model: str, asked: argparse.Namespace, **arguments: Any) -> brl.Run:
    """Return the run of this model in ``out``, which is trained unless it is there."""
    there = [run for run in out.glob(f"*/{model}-bptt-*") if brl.load(run).status.get("state") == "finished"]
    if there:
        return brl.load(there[0])
    seeds = range(asked.first, asked.first + asked.seeds)
    return brl.train("bptt", model, seeds=seeds, out=out, progress=False, **arguments)


def fresh(run: brl.Run, seed: int) -> MotorPolicy:
    """Return a network that has learned nothing."""
    policy = run.policy(seed)
    policy.motor_network.load_state_dict(fresh_network(run.config, seed))
    return policy


def evaluator(experiment: Experiment, config: TrainConfig) -> Evaluator:
    """Return what does the same trials again and again; making it takes as long as a test."""
    if repr(experiment) not in _evaluators:
        _evaluators[repr(experiment)] = Evaluator(ExperimentTask(experiment), config.trial, TRIALS, SEED)
    return _evaluators[repr(experiment)]


_evaluators: dict[str, Evaluator] = {}


# --- lesions ----------------------------------------------------------------------------------------------------------


def lesioned(networks: dict[str, MotorPolicy], config: TrainConfig) -> Iterator[dict[str, object]]:
    """Yield what networks, and an arm that nobody drives, do in each condition with each side alone."""
    assert config.experiment is not None
    for condition, experiment in in_conditions(config.experiment).items():
        tests = evaluator(experiment, config)
        for network, policy in networks.items():
            for state, lesion in STATES.items():
                with policy.motor_network.lesioned(lesion):
                    yield {"network": network, "state": state, "condition": condition} | measured(tests.run(policy))
        silence = np.zeros((TRIALS, config.trial.trial_length, 6), dtype=np.float32)
        undriven = tests.run(Played(silence))
        yield {"network": "undriven", "state": "intact", "condition": condition} | measured(undriven)


def measured(record: TrialRecord) -> dict[str, float]:
    """Return the metrics of the study."""
    return measure(record, [find_metric(name) for name in METRICS])


# --- pulses -----------------------------------------------------------------------------------------------------------


def pushed(networks: dict[str, MotorPolicy], config: TrainConfig) -> Iterator[dict[str, object]]:
    """Yield by how much a pulse displaces the hand in a reach, by a pair of trials that differ in the pulse alone.

    ``played`` is the same for an arm that goes on with the commands of the reach without pulse: what muscles and
    inertia alone do. The feedback of a network is what it does better than that.
    """
    experiment = resolve("bptt", "force_pulse").experiment
    assert experiment is not None
    assert experiment.forces is not None
    assert experiment.forces.pulse is not None
    trial = dataclasses.replace(config.trial, trial_length=80)
    config = dataclasses.replace(config, trial=trial)
    pulse = experiment.forces.pulse
    always, never = (
        evaluator(
            dataclasses.replace(
                experiment, forces=dataclasses.replace(experiment.forces, pulse=dataclasses.replace(pulse, share=share))
            ),
            config,
        )
        for share in (1.0, 0.0)
    )
    for network, policy in networks.items():
        for state, lesion in STATES.items():
            with policy.motor_network.lesioned(lesion):
                plain, with_pulse = never.run(policy), always.run(policy)
            played = always.run(Played(plain.excitation))
            row: dict[str, object] = {"network": network, "state": state}
            for name, record in (("closed", with_pulse), ("played", played)):
                away = 100 * np.linalg.norm(record.hand - plain.hand, axis=2)  # (n, T + 1), cm
                first = int(record.plan.pulse[:, 0].min())
                row |= {f"{name}_peak_cm": away[:, first : first + 30].max(1).mean()}
                row |= {f"{name}_end_cm": away[:, -1].mean()}
            effort = float((plain.excitation**2).mean())
            error = 100 * float(plain.distance[:, -1].mean())
            yield row | {"squared_excitation": effort, "final_error_cm": error}


# --- statistics -------------------------------------------------------------------------------------------------------


def verdicts(blocks: pd.DataFrame, lesions: pd.DataFrame, pulses: pd.DataFrame) -> pd.DataFrame:
    """Compare what the questions ask for, paired by seed within each model."""
    rows: list[dict[str, object]] = []
    for model, of_model in blocks.groupby("model"):
        rows += _of_blocks(str(model), of_model)
    for model, of_model in lesions.groupby("model"):
        rows += _of_lesions(str(model), of_model)
    for model, of_model in pulses.groupby("model"):
        rows += _of_pulses(str(model), of_model)
    table = pd.DataFrame(rows)
    table["p_holm"] = table.groupby("family")["p"].transform(lambda p: holm(p.to_numpy()))
    return table


def _row(family: str, model: str, question: str, first: pd.Series, second: pd.Series) -> dict[str, object]:
    both = pd.concat([first, second], axis=1, join="inner")
    a, b = (both.iloc[:, i].to_numpy(dtype=np.float64) for i in range(2))
    difference = difference_interval(a, b, paired=True)
    values = {"first": a.mean(), "second": b.mean(), "difference": difference.value}
    interval = {"low": difference.low, "high": difference.high, "n": difference.n, "p": paired_test(a, b).p}
    return {"family": family, "model": model, "question": question} | values | interval


def _zero(values: pd.Series) -> pd.Series:
    return pd.Series(0.0, index=values.index)


def _of_blocks(model: str, table: pd.DataFrame) -> Iterable[dict[str, object]]:
    def at(who: str, condition: str, measure: str, block: int) -> pd.Series:
        rows = table[(table["adapting"] == who) & (table["condition"] == condition)]
        last = rows["block"].max() if block < 0 else block
        return rows[rows["block"] == last].set_index("seed")[measure]

    deviation = "signed_deviation"
    first, late = (at("all", "field", deviation, block) for block in (0, -1))
    yield _row("adaptation", model, "first deviation in the field against 0 (cm)", first, _zero(first))
    yield _row("adaptation", model, "size of deviation, first against last block (cm)", first.abs(), late.abs())
    after, before = (at("all", "null", deviation, block) for block in (-1, 0))
    yield _row("adaptation", model, "after-effect against before (cm)", after, before)
    pressed, before = (at("all", "channel", "channel_compensation", block) for block in (-1, 0))
    yield _row("adaptation", model, "compensation against before", pressed, before)
    yield _row("adaptation", model, "compensation against 1", pressed, _zero(pressed) + 1)
    for name, condition in (("channel_compensation", "channel"), ("perpendicular_deviation", "field")):
        sides = [at(side, condition, name, -1) for side in ("dominant", "non_dominant")]
        yield _row("side_that_adapts", model, f"{name}: dominant alone against non-dominant alone", *sides)
        for side, values in zip(("dominant", "non_dominant"), sides, strict=True):
            start = at("all", condition, name, 0)
            yield _row("side_that_adapts", model, f"{name}: {side} alone against before", values, start)


def _of_lesions(model: str, table: pd.DataFrame) -> Iterable[dict[str, object]]:
    def of(network: str, state: str, condition: str, measure: str) -> pd.Series:
        rows = table[(table["network"] == network) & (table["state"] == state) & (table["condition"] == condition)]
        return rows.set_index("seed")[measure]

    for state in STATES:
        pair = [of(network, state, "channel", "channel_compensation") for network in ("after", "before")]
        yield _row("lesions", model, f"compensation, {state}: after against before", *pair)
    for network in ("before", "after"):
        for condition in ("null_field", "field"):
            sides = [of(network, f"{side}_alone", condition, "final_error") for side in ALONE]
            yield _row("lesions", model, f"final error {condition}, {network}: dominant - non-dominant alone", *sides)
            undriven = of("undriven", "intact", condition, "final_error")
            for side, values in zip(ALONE, sides, strict=True):
                yield _row(
                    "floor", model, f"final error {condition}, {network}: {side} alone - undriven", values, undriven
                )


def _of_pulses(model: str, table: pd.DataFrame) -> Iterable[dict[str, object]]:
    def of(state: str, measure: str, network: str = "before") -> pd.Series:
        return table[(table["network"] == network) & (table["state"] == state)].set_index("seed")[measure]

    for name in ("closed_peak_cm", "closed_end_cm"):
        sides = [of(f"{side}_alone", name) for side in ALONE]
        yield _row("pulse", model, f"{name}: dominant - non-dominant alone", *sides)
    for state in STATES:
        for when in ("peak", "end"):
            pair = [of(state, f"{how}_{when}_cm") for how in ("closed", "played")]
            yield _row("pulse", model, f"{when} displacement, {state}: feedback - commands played", *pair)


if __name__ == "__main__":
    main()
