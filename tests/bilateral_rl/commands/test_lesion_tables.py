"""What is printed of lesions: the table, the floor, the index, and deep minus shallow."""

import io

import numpy as np
import pandas as pd
import pytest
from rich.console import Console
from scipy import stats
from treatments import treated

from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.analysis.results import COLUMNS, read_results
from bilateral_rl.commands.lesion_tables import print_lesions

METRIC = "goal_completion_5cm"
FRESH = [5.0, 6.0, 5.0, 7.0, 6.0]
SHALLOW, DEEP = "shallow_dominant", "deep_dominant"
OTHER_SHALLOW, OTHER_DEEP = "shallow_non_dominant", "deep_non_dominant"
NOTHING_KEPT = dict.fromkeys((SHALLOW, DEEP, OTHER_SHALLOW, OTHER_DEEP, "callosum"), FRESH)
MOST_KEPT = {
    SHALLOW: [20.0, 25.0, 21.0, 26.0, 22.0], DEEP: [30.0, 36.0, 31.0, 35.0, 33.0],
    OTHER_SHALLOW: [20.0, 2.0, 25.0, 1.0, 14.0], OTHER_DEEP: [10.0, 12.0, 11.0, 13.0, 10.0],
    "callosum": [70.0, 75.0, 71.0, 72.0, 80.0],
}  # fmt: skip


def results(protocols, seeds=5, control=True):
    """Of a cc_s: protocols by name, each with the values of its lesions."""
    rows = [
        ("cc_s", "random_reach", "bptt", seed, lesion, *treated(protocol, network), METRIC, value)
        for protocol, lesions in protocols.items()
        for lesion, values in ({"intact": [94.0, 95.0, 93.0, 96.0, 92.0]} | lesions).items()
        for network, of_seeds in (("trained", values), ("fresh", FRESH))[: 1 + control]
        for seed, value in enumerate(of_seeds[:seeds])
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def printed(table, width=80):
    console = Console(file=io.StringIO(), width=width)
    print_lesions(table, [find_metric(METRIC)], console)
    return console.file.getvalue()


def cells(out):
    """The rows of all tables, without their heads."""
    return [[cell.strip() for cell in line[1:-1].split("│")] for line in out.splitlines() if line.startswith("│")]


def words(out):
    return " ".join(out.split())


@pytest.fixture(scope="module")
def out():
    return printed(results({"none": NOTHING_KEPT, "everything": MOST_KEPT}))


def test_protocols_are_columns_and_the_control_is_a_line_beneath_each_lesion(out):
    head, *rows = cells(out)
    assert head == ["Goal completion within 5 cm (%)", "", ""]
    lesions = ["intact", "shallow dominant", "deep dominant", "shallow non-dominant", "deep non-dominant", "callosum"]
    assert [row[0] for row in rows[:12]] == [name for lesion in lesions for name in (lesion, "fresh network")]
    assert rows[10:12] == [["callosum", "5.8 ± 0.8", "73.6 ± 4.0"], ["fresh network", "5.8 ± 0.8", "5.8 ± 0.8"]]
    assert "mean ± standard deviation over 5 seeds" in out


def test_states_that_are_no_better_than_the_control_are_named_by_protocol(out):
    text = words(out)
    assert "No better than fresh networks that were treated alike (lost or relearned, not kept)" in text
    assert "without retraining: every lesion" in text
    assert "everything retrained: shallow non-dominant" in text


def test_few_exceptions_are_said_as_such():
    lost = dict.fromkeys((SHALLOW, DEEP, OTHER_SHALLOW, OTHER_DEEP), FRESH)
    assert "everything retrained: all but callosum" in words(printed(results({"everything": MOST_KEPT | lost})))
    kept = {OTHER_SHALLOW: MOST_KEPT[SHALLOW]}
    assert "everything retrained: no lesion" in words(printed(results({"everything": MOST_KEPT | kept})))


def test_of_a_single_lesion_it_is_said_whether_it_was_kept():
    def said(values):
        table = results({"everything": MOST_KEPT | {DEEP: values}})
        return words(printed(table[table["lesion"].isin(["intact", DEEP])]))

    assert "everything retrained: no lesion" in said(MOST_KEPT[SHALLOW])
    assert "everything retrained: every lesion" in said(FRESH)


def test_the_index_of_hemispheres_at_the_floor_is_not_shown(out):
    d, n = (np.array(MOST_KEPT[lesion]) for lesion in (OTHER_DEEP, DEEP))
    index = (d - n) / (d + n)
    text = words(out)
    assert "without retraining: at the floor" in text
    assert f"everything retrained: {index.mean():.3f} ± {index.std(ddof=1):.3f}" in text


def test_deep_minus_shallow_stands_below_for_each_side_and_protocol(out):
    rows = [row for row in cells(out) if row[0] in ("dominant", "non-dominant")]
    assert [row[0] for row in rows] == ["dominant", "non-dominant"] * 2
    test = stats.ttest_rel(MOST_KEPT[DEEP], MOST_KEPT[SHALLOW])
    low, high = test.confidence_interval()
    assert rows[2][1:2] == [f"+10.20 [{low:.2f}, {high:.2f}]"]
    assert rows[2][3] == "< 0.001" == f"< {max(0.001, 2 * test.pvalue)}"
    assert rows[0][2:] == rows[1][2:] == ["–", "–"]
    assert "adjusted by Holm for the sides" in words(out)


def test_without_control_nothing_is_said_of_it():
    text = printed(results({"none": NOTHING_KEPT, "everything": MOST_KEPT}, control=False))
    assert "fresh" not in text
    assert "at the floor" not in text
    assert "without retraining: +0.000 ± 0.000" in words(text)


def test_one_seed_has_no_test():
    text = printed(results({"none": NOTHING_KEPT, "everything": MOST_KEPT}, seeds=1))
    assert "everything retrained: -0.500" in words(text)
    assert "Holm" not in text
    assert "±" not in text


@pytest.mark.parametrize(("width", "tables"), [(80, 3), (100, 2), (160, 1)])
def test_many_protocols_go_on_in_a_further_table(width, tables):
    names = ["none", "output", "combination", "everything", "everything-3-epochs", "output-3-epochs-lr-0.01",
             "everything-penalty-activity-0.01-continued-training-trials"]  # fmt: skip
    text = printed(results(dict.fromkeys(names, MOST_KEPT)), width)
    assert text.count("mean ± standard deviation") == tables
    assert all(len(line) <= width for line in text.splitlines())
    assert sum(len(row) - 1 for row in cells(text) if row[0] == "callosum") == len(names)
    assert "…" not in text


def test_a_table_of_version_0_1_0_is_printed_too(tmp_path):
    rows = [
        f"cc_s,random_reach,bptt,{seed},{lesion},{retrained},{METRIC},{value}"
        for lesion, value in (("intact", 90), (DEEP, 20), (OTHER_DEEP, 60))
        for retrained in (False, True)
        for seed in range(2)
    ]
    (tmp_path / "lesions.csv").write_text("\n".join(["model,task,algo,seed,lesion,retrained,metric,value", *rows]))
    text = words(printed(read_results(tmp_path / "lesions.csv")))
    assert "without retraining: +0.500 ± 0.000 output layer retrained: +0.500 ± 0.000" in text
    assert "fresh" not in text
