"""A training is refused before anything is made, checked once, and leaves the process as it was."""

import warnings

import pytest
import torch
from rl_runs import small_rl
from supervised_runs import Watch

from bilateral_rl.io.errors import UserError
from bilateral_rl.training import run as training
from bilateral_rl.training.build import build_algorithm
from bilateral_rl.training.run import check_device, prepare, prepare_resume, run, train


def test_a_device_is_taken_where_it_is_there(monkeypatch):
    for device, n_devices, words in (
        ("cuda", 0, "no CUDA device"),
        ("cuda:0", 0, "no CUDA device"),
        ("cuda:1", 1, "last one is cuda:0"),
        ("cuda:7", 2, "last one is cuda:1"),
    ):
        monkeypatch.setattr(torch.cuda, "is_available", lambda n=n_devices: n > 0)
        monkeypatch.setattr(torch.cuda, "device_count", lambda n=n_devices: n)
        with pytest.raises(UserError, match=words):
            check_device(device)
    for device in ("cpu", "cuda", "cuda:0", "cuda:1"):
        check_device(device)


@pytest.mark.parametrize("algo", ["ppo", "sac", "bptt"])
def test_a_training_leaves_threads_and_warnings_of_the_process_as_they_were(tmp_path, small_bptt, algo):
    torch.set_num_threads(2)
    try:
        filters = list(warnings.filters)
        train(small_bptt(epochs=1) if algo == "bptt" else small_rl(algo, timesteps=400), tmp_path)
        assert torch.get_num_threads() == 2
        assert warnings.filters == filters
    finally:
        torch.set_num_threads(1)


def test_a_fresh_network_does_not_depend_on_the_threads_of_the_process(same_bits):
    config = small_rl("a2c", network={"critic_arch": [64, 64]})
    weights = []
    for threads in (1, 2):
        torch.set_num_threads(threads)
        weights.append(dict(build_algorithm(config).policy.state_dict()))
    torch.set_num_threads(1)
    assert same_bits(*weights)


def test_what_prepare_refuses_leaves_no_folder(tmp_path, run_of_another_size):
    with pytest.raises(UserError, match="--init-from needs the same"):
        prepare(small_rl("ppo", init_from=str(run_of_another_size.path)))
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def run_of_another_size(tmp_path_factory):
    return train(small_rl("ppo", network={"units": 12}, timesteps=400), tmp_path_factory.mktemp("other")).folder


def test_what_is_prepared_is_not_checked_again(tmp_path, monkeypatch):
    checked = []
    for name in ("check_device", "initial_states"):
        check = getattr(training, name)
        monkeypatch.setattr(training, name, lambda *a, name=name, check=check: [checked.append(name), check(*a)][1])
    prepared = prepare(small_rl("ppo", timesteps=400))
    folder = run(prepared, tmp_path).folder
    assert checked == ["check_device", "initial_states"]
    run(prepare_resume(folder, small_rl("ppo", timesteps=800)), tmp_path)
    assert checked == ["check_device", "initial_states", "check_device"]


def test_a_learner_that_cannot_be_built_leaves_no_folder(tmp_path, monkeypatch):
    def too_large(config):
        raise MemoryError

    monkeypatch.setattr("bilateral_rl.training.rl.build_algorithm", too_large)
    with pytest.raises(MemoryError):
        train(small_rl("ppo"), tmp_path)
    assert list(tmp_path.glob("*/*")) == []


def test_a_stop_is_answered_at_once_and_once(tmp_path, small_bptt):
    class Answered(Watch):
        answers = 0

        def on_stop(self):
            self.answers += 1

    for config in (small_rl("ppo"), small_bptt()):
        watch = Answered(stop_at=1)
        assert train(config, tmp_path, watch).interrupted
        assert watch.answers == 1
