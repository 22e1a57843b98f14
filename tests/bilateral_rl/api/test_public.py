"""What is public is listed here by its signature, so that a change of it is a decision."""

import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import bilateral_rl as brl
from bilateral_rl import api
from bilateral_rl.api.run import Run
from bilateral_rl.api.wording import argument

ROOT = Path(__file__).parents[3]
TESTS = "trials=1024, *, seed=2000000"
CONDITIONS = "lesion='intact', task=None, settings=None"
FILM = (
    "trials=4, seed=2000000, lesion='intact', weights='final', slow_down=4, size=480, task=None, settings=None, "
    "progress=True"
)
SIGNATURES = {
    "compare": f"(*runs, metrics=None, retrain=None, {TESTS.replace(' *,', '')}, task=None)",
    "import_model": "(model, task, *, trust_pickle=False, settings=None, vec_normalize=None, out='runs')",
    "list_runs": "(out='runs')",
    "load": "(run, seed=None)",
    "plot_blocks": "(blocks, ax=None, *, measure='deviation_at_peak_speed')",
    "plot_center_out": "(recording, ax=None, *, seed=None, lesion=None)",
    "plot_channel": "(recording, ax=None, *, seed=None, lesion=None)",
    "plot_curves": "(curves, ax=None, *, measure=None, by_hand=False)",
    "plot_lesions": "(results, ax=None, *, metric=None, model=None)",
    "plot_muscles": "(recording, ax=None, *, seed=None, lesion=None)",
    "plot_paths": "(recording, ax=None, *, trials=12, seed=None, lesion=None)",
    "plot_speeds": "(recording, ax=None)",
    "render": f"(*runs, out=None, {FILM})",
    "reproduce": "(algo='bptt', profile='paper', models=None, *, study='paper', tasks=None, seeds=None, "
    "quick=False, jobs=None, ray=None, settings=None, readings=None, out=None, progress=True)",
    "sweep": "(grid, algo='bptt', *, seeds=None, settings=None, trials=1024, jobs=None, ray=None, out='runs/sweep', "
    "progress=True)",
    "train": "(algo=None, model=None, task=None, *, timesteps=None, epochs=None, seeds=None, profile=None, seed=None, "
    "n_envs=None, units=None, layers=None, threshold=None, device=None, init_from=None, track=None, config=None, "
    "settings=None, out='runs', progress=True)",
    "Run.curves": "()",
    "Run.blocks": "()",
    "Run.policy": "(seed=None, lesion='intact', weights='final')",
    "Run.evaluate": f"({TESTS}, {CONDITIONS}, deterministic=True, weights='final', by='seed')",
    "Run.lesion": "(lesions=None, retrain=None, *, retrain_epochs=None, retrain_learning_rate=None, "
    "retrain_optimizer=None, retrain_trials=None, retrain_penalty=None, retrain_penalty_coefficient=None, "
    "control=True, profile=None, spring=None, trials=1024, seed=2000000, weights='final', task=None, out=None, "
    "progress=True)",
    "Run.export": "(out, *, trials=1024, seed=2000000, weights='final', task=None)",
    "Run.record": f"({TESTS.replace('1024', '128')}, {CONDITIONS}, weights='final', progress=True)",
    "Run.record_to": f"(out, {TESTS.replace('1024', '128')}, {CONDITIONS}, weights='final', progress=True)",
    "Run.render": f"(out=None, *, {FILM})",
    "Run.resume": "(timesteps=None, epochs=None, *, device=None, track=None, task=None, progress=True)",
}
PROPERTIES = ["config", "folder", "lesions_folder", "name", "only", "path", "seeds", "status"]


def signature(function):
    """Its arguments and their defaults."""
    parameters = [
        p.replace(annotation=p.empty) for p in inspect.signature(function).parameters.values() if p.name != "self"
    ]
    return str(inspect.Signature(parameters))


def public():
    """Every public function by name, and every method of :class:`Run`."""
    functions = {name: getattr(brl, name) for name in api.__all__ if inspect.isfunction(getattr(brl, name))}
    methods = {f"Run.{name}": m for name, m in inspect.getmembers(Run, inspect.isfunction) if not name.startswith("_")}
    return functions | methods


def test_signatures_are_as_listed():
    assert {name: signature(function) for name, function in public().items()} == SIGNATURES


def test_a_run_tells_what_is_listed():
    told = {name for name, _ in inspect.getmembers(Run, lambda m: isinstance(m, property))}
    assert sorted(told | set(Run.__dataclass_fields__)) == PROPERTIES


def test_every_word_is_listed_typed_and_documented():
    assert {*api.__all__} <= {*brl.__all__} & {*dir(brl)} & {*dir(api)}
    for name, function in public().items():
        parameters = inspect.signature(function).parameters
        assert all(p.annotation is not p.empty for p in parameters.values() if p.name != "self"), name
        described = inspect.getdoc(function)
        arguments = [p for p in parameters if p != "self"]
        assert all(re.search(rf"^ +{p}: ", described, re.MULTILINE) for p in arguments), name


def test_every_option_that_an_error_may_name_is_an_argument():
    known = {p for function in public().values() for p in inspect.signature(function).parameters}
    named = set()
    for path in ROOT.glob("bilateral_rl/**/*.py"):
        if not {"commands", "zoo"} & {*path.parts}:
            sentences = re.findall(r"UserError\((?:[^()]|\([^()]*\))*\)", path.read_text(encoding="utf-8"))
            named |= {option for text in sentences for option in re.findall(r"(?<![\w-])--[a-z]+(?:-[a-z]+)*", text)}
    assert len(named) > 10
    whole_sentences = {"--retrain-", "--resume"}  # the beginning of several; and a method
    assert {option for option in named if argument(option).split("=")[0] not in known} <= whole_sentences


def test_a_notebook_begins_quickly():
    assert not [name for name in loaded_by("bilateral_rl") if name.startswith("bilateral_rl.")]


def test_what_needs_no_statistics_does_without_scipy():
    of_one_run = [f"bilateral_rl.commands.{name}" for name in ("train", "evaluate", "record", "render", "export")]
    assert "scipy" not in loaded_by(*of_one_run)  # which takes half a second


def loaded_by(*modules):
    code = f"import json, sys, {', '.join(modules)}; print(json.dumps(sorted(sys.modules)))"
    return json.loads(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)
