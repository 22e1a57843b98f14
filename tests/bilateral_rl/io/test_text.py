from bilateral_rl.io.text import seed_counts, seed_range


def test_seeds_by_number():
    assert [seed_range([3]), seed_range([2, 0, 1])] == ["seed 3", "seeds 0 to 2"]


def test_how_many_seeds_there_are():
    assert [seed_counts(n) for n in ([], [1], [5, 5], [5, 3])] == ["0 seeds", "1 seed", "5 seeds", "3 to 5 seeds"]
