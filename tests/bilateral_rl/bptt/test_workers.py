"""Threads that share work: every part of it is done once, and what goes wrong is told."""

import contextlib
import threading

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from bilateral_rl.bptt.workers import Workers


@pytest.fixture(params=[1, 3])
def workers(request):
    with contextlib.closing(Workers(request.param)) as some:
        yield some


@given(n=st.integers(1, 200), n_workers=st.integers(1, 9))
def test_parts_cover_everything_once_in_order_and_nearly_evenly(n, n_workers):
    with contextlib.closing(Workers(n_workers)) as workers:
        parts = workers.parts(n)
    assert [i for part in parts for i in part] == list(range(n))
    assert len(parts) == min(n, n_workers)
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_every_job_is_done_once_before_sharing_returns(workers):
    done = []
    workers.share([lambda i=i: done.append(i) for i in range(50)])
    assert sorted(done) == list(range(50))


def test_a_jobs_error_reaches_the_caller(workers):
    def fail():
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        workers.share([lambda: None, fail])


def test_one_worker_is_the_calling_thread_and_several_are_not():
    for n in (1, 3):
        seen = []
        with contextlib.closing(Workers(n)) as workers:
            workers.share([lambda seen=seen: seen.append(threading.current_thread())] * 10)
        assert (threading.current_thread() in seen) == (n == 1)


def test_torch_uses_one_thread_in_each_whatever_it_uses_elsewhere():
    seen, before = [], torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        with contextlib.closing(Workers(3)) as workers:
            workers.share([lambda: seen.append(torch.get_num_threads())] * 10)
    finally:
        torch.set_num_threads(before)
    assert set(seen) == {1}


def test_none_named_is_as_many_as_there_are_cpus(monkeypatch):
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 3, 5})
    with contextlib.closing(Workers(0)) as workers:
        assert workers.n == 3
        assert len(workers.parts(100)) == 3


def test_closed_workers_take_no_jobs():
    workers = Workers(2)
    workers.close()
    with pytest.raises(RuntimeError):
        workers.share([lambda: None])
