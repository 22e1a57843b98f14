import io

import pytest
from rich.console import Console

from bilateral_rl.study.board import ConsoleBoard, duration
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


def ended(job, state):
    return JobOutcome(job, state, 1.0)


def test_a_fraction_counts_the_cost_of_jobs(jobs, lines):
    a, b, _c = jobs
    lines.begin(jobs, {"c"})
    assert lines.fraction() == pytest.approx(1 / 10)
    lines.on_start(a)
    lines.on_progress(a, 0.5, "")
    assert lines.fraction() == pytest.approx((1 + 3) / 10)
    lines.on_end(ended(a, JobState.DONE))
    lines.on_start(b)
    lines.on_end(ended(b, JobState.FAILED))
    assert lines.fraction() == 1.0
    assert lines.summary() == "2 of 3 jobs done, 1 failed"


def test_what_is_left_takes_as_long_as_what_was_done_for_its_cost(jobs, lines, clock):
    a, _b, _c = jobs
    lines.begin(jobs, set())
    clock.seconds = 5.0
    assert lines.remaining() is None
    lines.on_start(a)
    lines.on_progress(a, 0.0, "")
    lines.on_progress(a, 0.5, "")
    clock.seconds = 30.0
    assert lines.remaining() == pytest.approx(70.0)  # 3 of 10 took 30 s
    lines.on_end(ended(a, JobState.DONE))
    clock.seconds = 60.0
    assert lines.remaining() == pytest.approx(40.0)


def test_what_was_done_before_took_no_time_now(jobs, lines, clock):
    a, _b, _c = jobs
    lines.begin(jobs, {"b"})
    lines.on_start(a)
    lines.on_progress(a, 0.5, "")  # where it was when it was interrupted
    clock.seconds = 10.0
    assert lines.remaining() is None
    lines.on_progress(a, 0.75, "")
    clock.seconds = 30.0
    assert lines.remaining() == pytest.approx(30.0 * (1.5 + 1) / 1.5)


def test_a_job_that_failed_at_once_promises_nothing(jobs, lines, clock):
    a, b, _c = jobs
    lines.begin(jobs, set())
    lines.on_start(b)
    lines.on_end(ended(b, JobState.FAILED))
    clock.seconds = 1.0
    assert lines.remaining() is None
    lines.on_start(a)
    lines.on_progress(a, 0.0, "")
    lines.on_progress(a, 0.5, "")
    clock.seconds = 30.0
    assert lines.remaining() == pytest.approx(30.0 * (3 + 1) / 3)


def test_a_job_that_starts_once_more_begins_anew(jobs, lines):
    lines.begin(jobs, set())
    lines.on_start(jobs[0])
    lines.on_progress(jobs[0], 0.5, "")
    lines.on_start(jobs[0])
    assert lines.fraction() == 0.0


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


def test_durations_are_short():
    for seconds, text in (
        (0, "0 s"),
        (59.4, "59 s"),
        (59.6, "1 min"),
        (3569, "59 min"),
        (3599, "1 h 00 min"),
        (7500, "2 h 05 min"),
    ):
        assert duration(seconds) == text
