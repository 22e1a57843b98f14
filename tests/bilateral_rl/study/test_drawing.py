"""Which figures a study comes to; how each looks is the business of the figures' own tests."""

import pandas as pd
from made_up_results import make_results

from bilateral_rl.analysis.results import COLUMNS
from bilateral_rl.study.drawing import compared_metrics, draw_study
from bilateral_rl.training.run import train

RADII = {"random_reach": 0.05, "hold_position": 0.05}
OF_MODELS = {
    "models_random_reach",
    "posthoc_random_reach_goal_completion_5cm_games_howell",
    "posthoc_random_reach_goal_completion_5cm_tukey",
    "posthoc_random_reach_speed_to_goal_5cm_games_howell",
    "posthoc_random_reach_speed_to_goal_5cm_tukey",
    "models_hold_position",
    "posthoc_hold_position_time_in_goal_5cm_games_howell",
    "posthoc_hold_position_time_in_goal_5cm_tukey",
}
OF_LESIONS = {"lesions_random_reach", "lesions_hold_position", "specialization_output", "specialization_none"}


def draw(results, runs=None):
    drawings = list(draw_study(results, RADII, runs or {}))
    names = [drawing.name for drawing in drawings]
    assert len(set(names)) == len(names)
    assert all(drawing.caption.endswith(".") for drawing in drawings)
    return {drawing.name: drawing for drawing in drawings}


def few_models():
    return make_results(without=("uni_dl", "uni_ndl", "bi_ns", "cc_ns"), seeds=3)


def test_all_that_results_show_is_drawn_and_a_model_that_never_reaches_its_goal_too():
    results = few_models()
    results.loc[(results["model"] == "uni_b") & (results["metric"] == "speed_to_goal_5cm"), "value"] = float("nan")
    assert draw(results).keys() == OF_MODELS | OF_LESIONS


def test_models_without_hemispheres_have_no_lesions():
    results = make_results(without=("bi_ns", "bi_s", "cc_ns", "cc_s"), seeds=2)
    assert draw(results).keys() == OF_MODELS


def test_what_is_missing_leaves_the_rest():
    results = few_models()
    one_model = (results["task"] == "hold_position") & (results["model"] != "bi_s")
    names = draw(results[~one_model]).keys()
    assert names == {name for name in OF_MODELS if "random_reach" in name} | OF_LESIONS
    assert not draw(results.iloc[:0])


def test_one_seed_is_drawn_too():
    results = make_results(without=("uni_dl", "uni_ndl", "bi_ns", "cc_ns"), seeds=1)
    assert draw(results[results["task"] == "hold_position"]).keys() > {"models_hold_position", "lesions_hold_position"}


def test_models_are_compared_by_the_preferred_metric_first():
    for radius in (0.05, 0.045):
        name = f"{100 * radius:g}cm"
        reach, hold = (compared_metrics(task, radius) for task in RADII)
        assert reach == [f"goal_completion_{name}", f"speed_to_goal_{name}", "effort", "sparc"]
        assert hold == [f"time_in_goal_{name}", "hold_speed", "effort"]


def test_runs_show_how_they_learned_and_what_their_first_seed_does(bptt_run):
    empty = pd.DataFrame(columns=list(COLUMNS))
    names = ["learning", "speed", "muscles", "hemispheres", "paths"]
    drawings = draw(empty, {"random_reach": {"cc_s": [bptt_run]}})
    assert [name.split("_")[0] for name in drawings] == names
    assert drawings["paths_random_reach_cc_s"].caption == "Random reach: hand paths of CC-S, from the dot to the disc."


def test_a_run_without_hemispheres_shows_none(small_bptt, tmp_path):
    alone = train(small_bptt("uni_b", "hold_position", epochs=1), tmp_path / "uni").folder
    drawings = draw(pd.DataFrame(columns=list(COLUMNS)), {"hold_position": {"uni_b": [alone]}})
    assert list(drawings) == ["learning_hold_position", "speed_hold_position", "paths_hold_position_uni_b"]
