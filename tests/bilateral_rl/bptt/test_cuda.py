"""Stacked training on a GPU. Skipped where there is none."""

import pytest
import torch
from rich_tasks import RICH_SETTINGS

from bilateral_rl.analysis.protocols import Protocol
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.config.resolve import resolve
from bilateral_rl.policies.lesions import Lesion
from bilateral_rl.runs.policies import build_network, network_states
from bilateral_rl.training.moments import trained_moments
from bilateral_rl.training.retraining import Retraining
from bilateral_rl.training.run import resume, train

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA GPU")

FEW = {"trials": 64, "batch_size": 16, "validation_trials": 8}
RICH = {"model": "cc_s", "trial": RICH_SETTINGS, "network": {"hidden_noise": 0.05}}
"""Every sense with its noise and delay, every loss, and noisy units."""


def trained(out, device, task="random_reach", **values):
    config = resolve("bptt", task, [{"seeds": 3, "epochs": 2, "device": device, "bptt": FEW} | values])
    return train(config, out).folder


@pytest.mark.parametrize(
    ("task", "profile"), [("random_reach", "paper"), ("random_reach", "released"), ("reach_and_hold", "paper")]
)
@pytest.mark.parametrize("model", ["uni_b", "bi_s", "cc_s"])
def test_a_gpu_trains_the_same_networks_as_the_cpu(tmp_path, model, task, profile):
    settings = {"model": model, "profile": profile}
    states = [network_states(trained(tmp_path, device, task, **settings)) for device in ("cpu", "cuda")]
    for seed in states[0]:
        for name, value in states[0][seed].items():
            torch.testing.assert_close(states[1][seed][name], value, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("task", ["curl_field", "force_pulse", "target_jump", "bimanual_curl_field"])
def test_a_gpu_trains_on_forces_timelines_noise_delays_and_further_losses_as_the_cpu_does(tmp_path, task):
    on_cpu, on_cuda = (network_states(trained(tmp_path, device, task, **RICH)) for device in ("cpu", "cuda"))
    for seed in on_cpu:
        for name, value in on_cpu[seed].items():
            torch.testing.assert_close(on_cuda[seed][name], value, rtol=1e-3, atol=3e-4)


def test_a_gpu_keeps_what_is_frozen_as_it_was(tmp_path):
    on_cpu, on_cuda = (trained(tmp_path, device, model="cc_s", frozen=["dominant"]) for device in ("cpu", "cuda"))
    names = [name for name in network_states(on_cpu)[0] if name.startswith("dominant.")]
    assert names
    for seed, state in network_states(on_cuda).items():
        for name in names:
            assert torch.equal(state[name], network_states(on_cpu)[seed][name])


def test_a_run_of_the_gpu_goes_on_on_the_cpu(tmp_path):
    folder = trained(tmp_path, "cuda")
    outcome = resume(folder, resolve(None, None, [folder.config().to_values() | {"epochs": 3, "device": "cpu"}]))
    assert outcome.done == 12


@pytest.mark.parametrize("task", ["random_reach", "reach_and_hold"])
@pytest.mark.parametrize(
    "protocol", [Protocol("output", epochs=2), Protocol("everything", optimizer="continued")], ids=lambda p: p.name
)
def test_a_gpu_retrains_the_same_networks_as_the_cpu(tmp_path, protocol, task):
    run = trained(tmp_path, "cpu", task)
    config, states = run.config(), network_states(run)
    rows, seeds = Layout(build_network(config)).pack(list(states.values())), list(states)
    moments = trained_moments(run, seeds, "final") if protocol.optimizer == "continued" else None
    on_cpu, on_cuda = (
        Retraining(config, protocol, device=device).run(rows, seeds, [Lesion(callosum=True)] * len(seeds), moments)
        for device in ("cpu", "cuda")
    )
    assert on_cuda.device.type == "cpu"
    assert not torch.equal(on_cpu, rows)
    torch.testing.assert_close(on_cuda, on_cpu, rtol=1e-3, atol=1e-4)
