import shutil

import pytest

from bilateral_rl.config import RLConfig
from bilateral_rl.resolve import resolve
from bilateral_rl.run_folder import RunFolder
from bilateral_rl.training import train

SMALL = {
    "timesteps": 4_000,
    "n_envs": 20,
    "ppo": {"batch_size": 250},
    "evaluation": {"every": 2_000, "checkpoint_every": 2_000, "trials": 8},
}


@pytest.fixture
def small() -> RLConfig:
    return resolve(None, None, [SMALL])


@pytest.fixture(scope="session")
def _trained(tmp_path_factory) -> RunFolder:
    return train(resolve(None, None, [SMALL]), tmp_path_factory.mktemp("runs")).folder


@pytest.fixture
def run(_trained, tmp_path) -> RunFolder:
    """A small finished run of its own copy, free to be damaged."""
    path = tmp_path / "runs" / "random_reach" / "cc_s-ppo-1"
    shutil.copytree(_trained.path, path)
    return RunFolder(path)
