import io

import pytest
from rich.console import Console

from bilateral_rl.study.board import ConsoleBoard, Tally, duration
from bilateral_rl.study.jobs import JobOutcome, JobState


class Clock:
    seconds = 0.0

    def __call__(self):
        return self.seconds


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def paper():
    return io.StringIO()


@pytest.fixture
def lines(paper, clock):
    """A board that no terminal shows."""
    return ConsoleBoard(Console(file=paper, width=80), "study", clock)


@pytest.fixture
def jobs(toy):
    return [toy("write", "a", cost=6), toy("write", "b", cost=3), toy("write", "c", cost=1)]


def test_a_fraction_counts_the_cost_of_jobs(jobs):
    a, b, _c = jobs
    tally = Tally(jobs, {"c"})
    assert tally.fraction() == pytest.approx(1 / 10)
    tally.start(a)
    tally.progress(a, 0.5)
    assert tally.fraction() == pytest.approx((1 + 3) / 10)
    tally.end(a, JobState.DONE)
    tally.start(b)
    tally.end(b, JobState.FAILED)
    assert tally.fraction() == 1.0
    assert tally.summary() == "2 of 3 jobs done, 1 failed"
    assert tally.states == {"a": JobState.DONE, "b": JobState.FAILED, "c": JobState.DONE}


def test_what_is_left_takes_as_long_as_what_was_done_for_its_cost(jobs):
    a, _b, _c = jobs
    tally = Tally(jobs, set())
    assert tally.remaining(5.0) is None
    tally.start(a)
    tally.progress(a, 0.0)
    tally.progress(a, 0.5)
    assert tally.remaining(30.0) == pytest.approx(70.0)  # 3 of 10 took 30 s
    tally.end(a, JobState.DONE)
    assert tally.remaining(60.0) == pytest.approx(40.0)


def test_what_was_done_before_took_no_time_now(jobs):
    a, _b, _c = jobs
    tally = Tally(jobs, {"b"})
    tally.start(a)
    tally.progress(a, 0.5)  # where it was when it was interrupted
    assert tally.remaining(10.0) is None
    tally.progress(a, 0.75)
    assert tally.remaining(30.0) == pytest.approx(30.0 * (1.5 + 1) / 1.5)


def test_a_job_that_failed_at_once_promises_nothing(jobs):
    a, b, _c = jobs
    tally = Tally(jobs, set())
    tally.start(a)
    tally.end(a, JobState.FAILED)
    assert tally.remaining(1.0) is None
    tally.start(b)
    tally.end(b, JobState.DONE)
    assert tally.remaining(31.0) == pytest.approx(31.0 / 3)


def test_a_job_that_starts_once_more_begins_anew(jobs):
    tally = Tally(jobs, set())
    tally.start(jobs[0])
    tally.progress(jobs[0], 0.5)
    tally.start(jobs[0])
    assert tally.fraction() == 0.0


def test_a_request_to_stop_is_answered_at_once(jobs, lines, paper):
    with lines as board:
        board.begin(jobs, set())
        board.on_interrupt()
        assert "Ctrl-C again kills" in paper.getvalue()


def test_without_a_terminal_there_is_a_line_a_job_and_one_in_half_a_minute(jobs, lines, paper, clock):
    a, b, _c = jobs
    with lines as board:
        board.begin(jobs, {"c"})
        board.on_start(a)
        for second in range(0, 70):
            clock.seconds = second
            board.on_progress(a, second / 60, f"epoch {second}")
            board.tick()
        board.on_end(JobOutcome(a, JobState.DONE, 250.0))
        board.on_start(b)
        board.on_end(JobOutcome(b, JobState.FAILED, 12.3, "ValueError: [bold] is wrong", "logs/b.log"))
    assert paper.getvalue().splitlines() == [
        "1 of 3 jobs were done before.",
        "study: 40 %, 1 of 3 jobs done, about 1 min left",  # 3 of 9 took 30 s
        "study: 70 %, 1 of 3 jobs done, about 30 s left",
        "a done after 4 min",
        "b failed after 12 s: ValueError: [bold] is wrong (logs/b.log)",
    ]


def test_on_a_terminal_running_jobs_have_a_bar_each(jobs, paper, clock):
    a, b, _c = jobs
    console = Console(file=paper, width=100, force_terminal=True, color_system=None, legacy_windows=False)
    with ConsoleBoard(console, "study", clock) as board:
        board.begin(jobs, set())
        board.on_start(a)
        board.on_start(b)
        board.on_progress(a, 0.0, "")
        clock.seconds = 60.0
        board.on_progress(a, 0.5, "epoch 50, [10 of 10] seeds")
        board.on_end(JobOutcome(b, JobState.DONE, 60.0))
        board.tick()
    *_, whole, running = [line for line in paper.getvalue().splitlines() if "%" in line]
    assert "60%" in whole
    assert "1 of 3 jobs done, about 40 s left" in whole
    assert "a" in running
    assert "50%" in running
    assert "epoch 50, [10 of 10] seeds" in running
    assert "b done after 1 min" in paper.getvalue()


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0 s"), (59.4, "59 s"), (59.6, "1 min"), (3569, "59 min"), (3599, "1 h 00 min"), (7500, "2 h 05 min")],
)
def test_durations_are_short(seconds, text):
    assert duration(seconds) == text
