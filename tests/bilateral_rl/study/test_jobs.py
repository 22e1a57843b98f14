import pytest

from bilateral_rl.study.jobs import Job, begin


def test_a_name_or_a_result_outside_the_study_is_refused():
    for path in ("", "/etc/passwd", "../other", "runs/../../other", "a\0b"):
        with pytest.raises(ValueError, match="not a path below"):
            Job(path, "m:f", "result.csv")
        with pytest.raises(ValueError, match="not a path below"):
            Job("name", "m:f", path)


def test_cost_and_threads_are_positive():
    for numbers in ({"cost": 0}, {"cost": -1.0}, {"threads": 0}):
        with pytest.raises(ValueError, match="must be positive"):
            Job("name", "m:f", "result.csv", **numbers)


def test_two_jobs_of_one_name_are_refused(tmp_path, toy):
    with pytest.raises(ValueError, match="one name"):
        begin([toy("write", "a"), toy("write", "a", text="other")], tmp_path)


def test_the_longest_is_first_and_equals_stay_in_order(tmp_path, toy):
    jobs = [toy("write", name, cost=cost) for name, cost in (("a", 1), ("b", 3), ("c", 1), ("d", 2))]
    _, to_do = begin(jobs, tmp_path)
    assert [job.name for job in to_do] == ["b", "d", "a", "c"]
