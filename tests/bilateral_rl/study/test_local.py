import multiprocessing
import os
import signal
import time

import pytest

from bilateral_rl.io.errors import UserError
from bilateral_rl.study.jobs import JobState
from bilateral_rl.study.local import run_local

DONE, FAILED, INTERRUPTED = JobState.DONE, JobState.FAILED, JobState.INTERRUPTED
TIMEOUT = 30.0


def wait_until(condition):
    deadline = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@pytest.fixture
def study(tmp_path, toy, events):
    """Two of three jobs running, in a process that leads a group, as one that a shell starts.

    It is forked from this one, which has imported all that takes long.
    """

    def run():
        os.setpgid(0, 0)
        outcomes = run_local([toy("save_when_asked", name) for name in "abc"], tmp_path, 2)
        (tmp_path / "states").write_text(" ".join(states(outcomes)))

    process = multiprocessing.get_context("fork").Process(target=run)
    process.start()
    wait_until(lambda: len(events(tmp_path)) == 2)
    yield process
    process.kill()
    process.join()


def states(outcomes):
    return [outcome.state for outcome in outcomes]


def interrupt_at(*moments):
    """A reaction that presses Ctrl-C when a board is told the first of ``moments``, then when it is the second, …"""
    left = list(moments)

    def react(told, name):
        if left and told == left[0]:
            left.pop(0)
            signal.raise_signal(signal.SIGINT)

    return react


def test_every_job_is_done_the_longest_first_and_outcomes_are_in_the_order_given(tmp_path, toy, events, watcher):
    jobs = [toy("write", name, cost=cost) for name, cost in (("short", 1), ("long", 3), ("tasks/middle", 2))]
    outcomes = run_local(jobs, tmp_path, 1, watcher)
    order = [name for name, what, _ in events(tmp_path) if what == "start"]
    assert order == ["long", "tasks/middle", "short"]
    assert [outcome.job for outcome in outcomes] == jobs
    assert states(outcomes) == [DONE] * 3
    assert (tmp_path / "tasks" / "middle").read_text() == "made"
    assert [told[:2] for told in watcher.told] == [(what, name) for name in order for what in ("start", "done")]


def test_so_many_run_at_once_and_no_more_each_in_a_process_of_its_own(tmp_path, toy, events):
    run_local([toy("write", name, seconds=0.5) for name in "abcdef"], tmp_path, 3)
    running, most = set(), 0
    for name, what, _ in events(tmp_path):
        running ^= {name}
        assert (what == "start") == (name in running)
        most = max(most, len(running))
    assert most == 3
    assert len({process for _, _, process in events(tmp_path)} - {os.getpid()}) == 6


def test_what_is_done_is_not_done_again(tmp_path, toy, events, watcher):
    jobs = [toy("write", name) for name in "ab"]
    run_local(jobs[:1], tmp_path, 1)
    outcomes = run_local(jobs, tmp_path, 1, watcher)
    assert states(outcomes) == [DONE, DONE]
    assert [name for name, what, _ in events(tmp_path) if what == "start"] == ["a", "b"]
    assert watcher.done_before == {"a"}
    assert outcomes[0].log == tmp_path / "logs" / "a.log"


def test_a_job_that_fails_says_why_and_stops_no_other(tmp_path, toy, watcher):
    failures = {
        "fail": ("ValueError: this is wrong", ["before it failed", "in fail", "ValueError: this is\nwrong"]),
        "leave": ("it left with exit code 3", ["before it left"]),
        "kill_itself": ("killed (SIGKILL); perhaps there was too little memory", ["--- kill_itself"]),
        "forget": ("it ended without writing forget", ["--- forget"]),
        "missing": ("AttributeError: module 'toy_jobs' has no attribute 'missing'", ["Traceback"]),
    }
    bad = [toy(function, function) for function in failures]
    outcomes = run_local([toy("write", "good", cost=2), *bad, toy("write", "late", cost=0.5)], tmp_path, 1, watcher)
    assert states(outcomes) == [DONE, *[FAILED] * len(bad), DONE]
    for outcome, (function, (error, logged)) in zip(outcomes[1:-1], failures.items(), strict=True):
        assert outcome.error == error
        log = outcome.log.read_text()
        assert all(text in log for text in logged)
        assert ("failed", function) in watcher.told


def test_a_job_sees_its_threads_no_terminal_and_no_import_that_it_did_not_ask_for(tmp_path, toy):
    (outcome,) = run_local([toy("environment", "seen", threads=2)], tmp_path, 1)
    assert (tmp_path / "seen").read_text() == "2,,False"
    header, *lines = outcome.log.read_text().splitlines()
    assert header.startswith("--- seen, 20")
    assert lines == ["to standard output", "to standard error"]


def test_a_failed_job_is_tried_again_and_its_log_grows(tmp_path, toy):
    for _ in range(2):
        (outcome,) = run_local([toy("fail", "bad")], tmp_path, 1)
    assert outcome.log.read_text().count("before it failed") == 2


def test_progress_reaches_the_board(tmp_path, toy, watcher):
    run_local([toy("tell", "a")], tmp_path, 1, watcher)
    progress = [(0.0, "step 0.0"), (0.25, "step 0.25"), (0.75, "step 0.75")]
    assert watcher.told == [("start", "a"), *(("progress", "a", *values) for values in progress), ("done", "a")]


def test_many_reports_reach_the_board_as_few(tmp_path, toy, watcher):
    run_local([toy("chatter", "a")], tmp_path, 1, watcher)
    seconds = float((tmp_path / "a").read_text())
    told = [values for what, _, *values in watcher.told if what == "progress"]
    assert told[0] == [0.0, "same"]
    assert len(told) <= 1 + seconds / 0.2


def test_ctrl_c_lets_running_jobs_save_and_starts_nothing_else(tmp_path, study, events, is_alive):
    os.killpg(study.pid, signal.SIGINT)  # as a terminal does
    study.join(TIMEOUT)
    assert (tmp_path / "states").read_text() == "interrupted interrupted interrupted"
    seen = events(tmp_path)
    assert sorted((name, what) for name, what, _ in seen) == [(n, w) for n in "ab" for w in ("saved", "start")]
    assert not any(is_alive(process) for _, _, process in seen)


def test_an_interrupted_study_goes_on(tmp_path, toy, make_watcher):
    jobs = [toy("save_when_asked", "a"), toy("write", "b", cost=0.5)]
    watcher = make_watcher(interrupt_at("progress"))
    before = signal.getsignal(signal.SIGINT)
    outcomes = run_local(jobs, tmp_path, 1, watcher)
    assert states(outcomes) == [INTERRUPTED, INTERRUPTED]
    assert outcomes[1].log is None
    assert signal.getsignal(signal.SIGINT) is before
    assert states(run_local(jobs, tmp_path, 1)) == [DONE, DONE]
    assert (tmp_path / "a").read_text() == "2 stretches"


def test_the_second_ctrl_c_kills(tmp_path, toy, events, is_alive, make_watcher):
    jobs = [toy("ignore_interrupts", name) for name in "ab"]
    began = time.monotonic()
    outcomes = run_local(jobs, tmp_path, 2, make_watcher(interrupt_at("progress", "tick")))
    assert states(outcomes) == [INTERRUPTED, INTERRUPTED]
    assert time.monotonic() - began < TIMEOUT
    assert not any(is_alive(process) for _, _, process in events(tmp_path))


def test_jobs_die_with_a_parent_that_is_killed(tmp_path, study, events, is_alive):
    processes = [process for _, _, process in events(tmp_path)]
    assert all(is_alive(process) for process in processes)
    study.kill()
    wait_until(lambda: not any(is_alive(process) for process in processes))


def test_no_process_at_all_is_refused(tmp_path, toy):
    with pytest.raises(UserError, match="--jobs a positive number"):
        run_local([toy("write", "a")], tmp_path, 0)


def test_a_study_that_cannot_be_written_is_refused(tmp_path, toy):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="Choose another --out"):
        run_local([toy("write", "a")], tmp_path / "file" / "study", 1)


def test_a_system_without_groups_of_processes_is_told_so(tmp_path, toy, monkeypatch):
    monkeypatch.delattr(os, "killpg")
    with pytest.raises(UserError, match="Linux and macOS"):
        run_local([toy("write", "a")], tmp_path, 1)
