"""Studies on a cluster of two nodes on this machine. A real cluster's nodes need share no folder; these note there
what they do, for the tests to see."""

import os
import signal
import sys
import time
from pathlib import Path

import pytest

from bilateral_rl.io.errors import UserError
from bilateral_rl.study.jobs import Job, JobState
from bilateral_rl.study.local import run_local
from bilateral_rl.study.ray_cluster import run_on_ray

HERE = Path(__file__).parent
DONE, FAILED, INTERRUPTED = JobState.DONE, JobState.FAILED, JobState.INTERRUPTED
TIMEOUT = 60.0
NODE = {"num_cpus": 1, "object_store_memory": 100 * 1024**2}
TRAINING = {
    "algo": "bptt",
    "task": "random_reach",
    "seeds": 2,
    "epochs": 2,
    "threads": 1,
    "bptt": {"trials": 128, "batch_size": 64},
}


@pytest.fixture
def workers_import_toy_jobs(monkeypatch):
    pytest.importorskip("ray")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(HERE), os.environ.get("PYTHONPATH")])))
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")


@pytest.fixture
def cluster(workers_import_toy_jobs):
    """Two nodes of one CPU each; the second may be killed."""
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={**NODE, "include_dashboard": False})
    cluster.second = cluster.add_node(**NODE)
    cluster.wait_for_nodes()
    yield cluster
    cluster.shutdown()


@pytest.fixture
def shared(tmp_path):
    folder = tmp_path / "shared"
    folder.mkdir()
    return folder


def training_job(model, shared):
    arguments = {"name": model, "config": {**TRAINING, "model": model}, "shared": str(shared)}
    return Job(model, "toy_trainings:work", f"{model}/done", arguments)


def ancestors(process):
    """Ids of the processes that a process descends from."""
    found = []
    while process > 1:
        try:
            process = int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])
        except FileNotFoundError:
            break
        found.append(process)
    return found


@pytest.fixture
def kill_second_node(cluster, shared, events):
    """A reaction that kills the second node when the first job there has noted ``moment``, and remembers that job."""
    (raylet,) = [process.process.pid for process in cluster.second.all_processes["raylet"]]

    def make(moment):
        def react(what, name):
            for job, noted, process in events(shared) if what == "tick" and not killed else []:
                if noted == moment and raylet in ancestors(process):
                    killed.append((job, process))
                    cluster.remove_node(cluster.second, allow_graceful=False)
                    return

        killed = []
        react.killed = killed
        return react

    return make


def contents(folder):
    """Bytes of every file but those that hold times, by name."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and "tfevents" not in path.name)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


@pytest.mark.slow
def test_every_job_ends_once_though_a_node_is_killed(
    cluster, kill_second_node, tmp_path, shared, toy, events, is_alive, make_watcher
):
    jobs = [toy("write", f"toy/{i}", seconds=2.0, shared=str(shared)) for i in range(6)]
    react = kill_second_node("start")
    watcher = make_watcher(react)
    outcomes = run_on_ray(jobs, tmp_path / "study", cluster.address, watcher)

    assert [(outcome.job, outcome.state) for outcome in outcomes] == [(job, DONE) for job in jobs]
    assert {name: text.decode() for name, text in contents(tmp_path / "study" / "toy").items()} == {
        str(i): "made" for i in range(6)
    }
    ((lost, process),) = react.killed
    assert not is_alive(process)
    names = sorted(job.name for job in jobs)
    assert sorted(name for name, what, _ in events(shared) if what == "start") == sorted([*names, lost])
    assert sorted(name for name, what, _ in events(shared) if what == "end") == names
    assert sorted(told[1] for told in watcher.told if told[0] == "start") == sorted([*names, lost])
    assert sorted(told[1] for told in watcher.told if told[0] == "done") == names


@pytest.mark.slow
def test_trainings_end_with_the_bits_of_a_local_run_though_a_node_is_killed(
    cluster, kill_second_node, tmp_path, shared, events, make_watcher
):
    jobs = [training_job(model, shared) for model in ("uni_b", "bi_s", "cc_s")]
    react = kill_second_node("epoch")
    watcher = make_watcher(react)
    outcomes = run_on_ray(jobs, tmp_path / "ray", cluster.address, watcher)
    assert [outcome.state for outcome in outcomes] == [DONE] * 3
    ((lost, _),) = react.killed
    epochs = [name for name, what, _ in events(shared) if what == "epoch"]
    assert {job.name: epochs.count(job.name) for job in jobs} == {job.name: 2 + (job.name == lost) for job in jobs}
    assert any(told[0] == "progress" and "validation loss" in told[3] for told in watcher.told)

    assert [outcome.state for outcome in run_local(jobs, tmp_path / "local", 2)] == [DONE] * 3
    for job in jobs:
        on_ray, locally = contents(tmp_path / "ray" / job.name), contents(tmp_path / "local" / job.name)
        assert f"random_reach/{job.name}-bptt-1/weights/final.safetensors" in locally
        assert on_ray == locally


@pytest.mark.slow
def test_failures_come_back_with_their_logs_and_are_not_tried_again(cluster, tmp_path, shared, toy):
    study = tmp_path / "study"
    jobs = [toy("fail", "fails"), toy("kill_itself", "dies"), toy("write", "done before"), toy("write", "good")]
    study.mkdir()
    (study / "done before").write_text("as it was")
    outcomes = run_on_ray(jobs, study, cluster.address)
    assert [outcome.state for outcome in outcomes] == [FAILED, FAILED, DONE, DONE]
    assert outcomes[0].error == "ValueError: this is wrong"
    assert outcomes[0].log.read_text().count("before it failed") == 1
    assert "Traceback" in outcomes[0].log.read_text()
    assert outcomes[1].error == "killed (SIGKILL); perhaps there was too little memory"
    assert (study / "done before").read_text() == "as it was"


@pytest.mark.slow
def test_what_takes_down_every_node_is_given_up(cluster, tmp_path, shared, toy, events, is_alive):
    job = toy("kill_the_node", "deadly", shared=str(shared))
    (outcome,) = run_on_ray([job], tmp_path / "study", cluster.address)
    assert outcome.state == FAILED
    assert outcome.error.startswith("WorkerCrashedError: The worker died unexpectedly")
    assert "died unexpectedly" in outcome.log.read_text()
    assert len(events(shared)) == 4
    assert not any(is_alive(process) for _, _, process in events(shared))


@pytest.mark.slow
def test_a_file_of_two_jobs_is_that_of_the_first(cluster, tmp_path, toy):
    outcomes = run_on_ray([toy("write", name) for name in "ab"], tmp_path, cluster.address)  # both write events.txt
    first, second = sorted(outcomes, key=lambda outcome: outcome.state)
    assert (first.state, second.state) == (DONE, FAILED)
    assert second.error == f"ValueError: it wrote events.txt, which is a file of {first.job.name}"
    assert not (tmp_path / second.job.name).exists()


@pytest.mark.slow
def test_ctrl_c_cancels(cluster, tmp_path, shared, toy, events, is_alive, make_watcher):
    def react(what, name):
        if what == "tick" and len(events(shared)) == 2 and not pressed:
            pressed.append(True)
            signal.raise_signal(signal.SIGINT)

    pressed = []
    jobs = [toy("write", name, seconds=60.0, shared=str(shared)) for name in "abc"]
    began = time.monotonic()
    outcomes = run_on_ray(jobs, tmp_path / "study", cluster.address, make_watcher(react))
    assert [outcome.state for outcome in outcomes] == [INTERRUPTED] * 3
    assert time.monotonic() - began < TIMEOUT
    assert len(events(shared)) == 2
    assert not any(is_alive(process) for _, _, process in events(shared))


@pytest.mark.slow
def test_a_cluster_of_this_machine_alone(workers_import_toy_jobs, tmp_path, toy):
    jobs = [toy("write", "a", shared=str(tmp_path))]
    (outcome,) = run_on_ray(jobs, tmp_path / "study", "local")
    assert outcome.state == DONE
    with pytest.raises(UserError, match="wide wants 4096 CPUs, but no node of the cluster has more than"):
        run_on_ray([toy("write", "wide", threads=4096)], tmp_path / "study", "local")


@pytest.mark.slow
def test_an_address_where_no_cluster_is_is_refused(workers_import_toy_jobs, tmp_path, toy):
    with pytest.raises(UserError, match=r"no Ray cluster to work with at 127\.0\.0\.1:1 \(.*refused\)"):
        run_on_ray([toy("write", "a")], tmp_path, "127.0.0.1:1")


def test_without_ray_one_is_told_how_to_get_it(tmp_path, toy, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UserError, match=r'pip install -c constraints.txt -e "\.\[ray\]"'):
        run_on_ray([toy("write", "a")], tmp_path, "local")
