"""Whatever lies in the place of a run's file is read or refused in a sentence: no other error, no harm, no hang."""

import hostile_files as hostile
import pytest
from loader_fuzzing import READ, REFUSED, fuzz, make_loaders, peak_memory

LOADERS = [f"{file} ({algo})" for algo in ("ppo", "sac", "bptt") for file in ("config.yaml", "weights", "resume")] + [
    "status.json (ppo)", "evaluations.csv (ppo)", "epochs.csv (bptt)", "study.yaml", "results",
]  # fmt: skip
MOST_MEMORY = 400 * 2**20
"""By which the process may grow (bytes); of the traps most would take 10 GB."""


@pytest.fixture(scope="module")
def loaders(tmp_path_factory):
    return make_loaders(tmp_path_factory.mktemp("fuzz"))


@pytest.mark.parametrize("name", LOADERS)
def test_no_trap_is_read_or_does_harm(loaders, name, tmp_path):
    loader, canary, outside = loaders[name], tmp_path / "canary", tmp_path / "outside"
    sound = loader.path.read_bytes()
    outside.write_bytes(sound)
    traps = loader.traps(sound, canary) | hostile.pickles(canary) | hostile.places(outside)
    memory = peak_memory(reset=True)
    try:
        outcomes = {trap: loader.outcome(what) for trap, what in traps.items()}
    finally:
        hostile.put(loader.path, sound)
    assert {trap for trap, outcome in outcomes.items() if outcome != REFUSED} == set()
    assert loader.outcome(sound) == READ
    assert not canary.exists()
    assert outside.read_bytes() == sound
    assert peak_memory() - memory < MOST_MEMORY


@pytest.mark.parametrize("name", LOADERS)
def test_a_few_dozen_inputs(loaders, name):
    n = 20 if _builds_policies(name) else 80
    outcomes = fuzz(loaders[name], n, number=0)
    assert outcomes[REFUSED] > n / 10


@pytest.mark.slow
@pytest.mark.parametrize("name", LOADERS)
def test_many_inputs(loaders, name):
    fuzz(loaders[name], 500 if _builds_policies(name) else 3_000, number=1)


def _builds_policies(name):
    return name.startswith(("weights", "resume")) and "bptt" not in name
