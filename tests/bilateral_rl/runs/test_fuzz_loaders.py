"""Whatever lies in the place of a run's file is read or refused in a sentence: no other error, no harm, no hang."""

import pytest
from loader_fuzzing import READ, REFUSED, fuzz, make_loaders

LOADERS = [
    "config.yaml", "config.yaml (bptt)", "config.yaml (sac)", "status.json", "weights", "weights (bptt)",
    "weights (sac)", "resume", "resume (bptt)", "resume (sac)", "settings.json", "study.yaml", "results", "epochs.csv",
    "evaluations.csv",
]  # fmt: skip
SLOW = ("weights", "weights (sac)", "resume", "resume (sac)")
"""They build policies."""


@pytest.fixture(scope="module")
def loaders(tmp_path_factory):
    return {loader.name: loader for loader in make_loaders(tmp_path_factory.mktemp("fuzz"))}


def test_every_loader_is_fuzzed(loaders):
    assert list(loaders) == LOADERS


@pytest.mark.parametrize("name", LOADERS)
def test_a_few_hundred_inputs(loaders, name):
    n = 20 if name in SLOW else 80
    outcomes = fuzz(loaders[name], n, number=0)
    assert outcomes[REFUSED] > n / 10
    assert outcomes.keys() <= {READ, REFUSED}


@pytest.mark.slow
@pytest.mark.parametrize("name", LOADERS)
def test_many_inputs(loaders, name):
    fuzz(loaders[name], 500 if name in SLOW else 3_000, number=1)
