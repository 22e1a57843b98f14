from itertools import combinations

import matplotlib
from matplotlib.colors import to_rgb

from bilateral_rl.config.catalogue import MODELS
from bilateral_rl.figures.labels import axis_label, lesion_label, model_label, task_label
from bilateral_rl.figures.style import MODEL_STYLES, families, forget_working_folder, in_order, model_style


def lightness(color):
    """Luma of Rec. 601, which pictures are converted to grey by."""
    return sum(weight * channel for weight, channel in zip((0.299, 0.587, 0.114), to_rgb(color), strict=True))


def test_every_model_has_a_style_and_none_shares_its_marker_or_color():
    assert list(MODEL_STYLES) == list(MODELS)
    assert len({style.marker for style in MODEL_STYLES.values()}) == len(MODELS)
    assert len({style.color for style in MODEL_STYLES.values()}) == len(MODELS)


def test_models_in_one_panel_differ_in_grey_by_lightness_and_line():
    for group in families(MODELS):
        for a, b in combinations(map(model_style, group), 2):
            assert abs(lightness(a.color) - lightness(b.color)) > 0.15
            assert a.line != b.line


def test_specialized_models_are_the_darker_ones():
    for plain, specialized in (("bi_ns", "bi_s"), ("cc_ns", "cc_s"), ("uni_b", "uni_dl"), ("uni_b", "uni_ndl")):
        assert lightness(MODEL_STYLES[specialized].color) < lightness(MODEL_STYLES[plain].color)


def test_models_stand_in_the_catalogues_order_and_others_after_them():
    assert in_order(["zebra", "cc_s", "uni_b", "ant", "cc_s"]) == ["uni_b", "cc_s", "ant", "zebra"]
    together = families(["cc_s", "zebra", "uni_ndl", "cc_ns", "uni_b"])
    assert together == [["uni_b", "uni_ndl"], ["cc_ns", "cc_s"], ["zebra"]]


def test_names_in_words():
    assert [model_label(name) for name in MODELS] == ["Uni-B", "Uni-DL", "Uni-NDL", "Bi-NS", "Bi-S", "CC-NS", "CC-S"]
    assert model_label("my_run") == "my_run"
    assert task_label("random_reach") == "Random reach"


def test_lesions_in_words():
    for name, words in (
        ("intact", "intact"),
        ("shallow_dominant", "shallow\ndominant"),
        ("shallow_non_dominant", "shallow\nnon-\ndominant"),
        ("callosum", "callosum"),
        ("callosum_deep_non_dominant", "callosum,\ndeep non-\ndominant"),
    ):
        assert lesion_label(name) == words


def test_axis_labels_keep_a_number_with_its_unit(completion, deviation):
    assert axis_label(completion) == "Goal completion\nwithin 5\u00a0cm (%)"
    assert axis_label(deviation) == "Maximal\nperpendicular\ndeviation (cm)"


def test_figures_do_not_follow_the_settings_of_the_working_folder(tmp_path, monkeypatch):
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\n")
    monkeypatch.chdir(tmp_path)
    with matplotlib.rc_context(fname="matplotlibrc"):
        assert matplotlib.rcParams["text.usetex"]
        forget_working_folder()
        assert not matplotlib.rcParams["text.usetex"]


def test_figures_follow_the_settings_of_their_user(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with matplotlib.rc_context({"lines.linewidth": 7}):
        forget_working_folder()
        assert matplotlib.rcParams["lines.linewidth"] == 7
