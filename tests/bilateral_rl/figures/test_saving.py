import io
from concurrent.futures import ThreadPoolExecutor

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib import pyplot
from PIL import Image

from bilateral_rl.figures.curves import HistoryColumn, learning_curves
from bilateral_rl.figures.models import model_comparison
from bilateral_rl.figures.posthoc import posthoc_matrix
from bilateral_rl.figures.saving import save
from bilateral_rl.io.errors import UserError

PAIRS = pd.DataFrame(
    [("bi_s", "cc_s", 1.5, 0.02), ("uni_b", "cc_s", 1.5, 0.02)], columns=["first", "second", "difference", "p"]
)


@pytest.fixture
def draw(make_results, completion):
    """Small figures of three kinds."""

    def figures():
        rng = np.random.default_rng(0)
        results = make_results(completion, {("bi_s", "intact", "none"): rng.random(3)})
        epochs = pd.DataFrame({"model": "bi_s", "seed": 0, "epoch": range(5), "loss": rng.random(5)})
        return [
            model_comparison(results, "random_reach", [completion]),
            posthoc_matrix(PAIRS, "p", completion, "Tukey’s HSD"),
            learning_curves(epochs, [HistoryColumn("loss", "Loss", logarithmic=True)], "learning"),
        ]

    return figures


def test_both_files_are_written_and_1280_pixels_can_be_shown(draw, tmp_path):
    png, pdf = save(draw()[0], tmp_path / "new" / "lambda-0.1")
    assert sorted(tmp_path.glob("new/*")) == [pdf, png]
    assert (png.name, pdf.name) == ("lambda-0.1.png", "lambda-0.1.pdf")
    assert Image.open(png).width >= 1280
    assert pdf.read_bytes().startswith(b"%PDF")


def test_the_same_figure_gives_the_same_bytes_drawn_again_or_saved_again(draw, tmp_path):
    for figure, again in zip(draw(), draw(), strict=True):
        first, second, third = (
            [path.read_bytes() for path in save(drawn, tmp_path / "figure")] for drawn in (figure, again, again)
        )
        assert first == second == third
        assert b"Date" not in first[1]


def test_what_cannot_be_drawn_leaves_the_files_that_were_there(draw, tmp_path, monkeypatch):
    figure = draw()[0]
    before = [path.read_bytes() for path in save(figure, tmp_path / "figure")]
    figure.axes[0].plot([0], [1])
    write = figure.savefig

    def fail_at_the_pdf(*args, format, **kwargs):
        if format == "pdf":
            raise RuntimeError("no")
        write(*args, format=format, **kwargs)

    monkeypatch.setattr(figure, "savefig", fail_at_the_pdf)
    with pytest.raises(RuntimeError, match="no"):
        save(figure, tmp_path / "figure")
    assert [(tmp_path / f"figure{suffix}").read_bytes() for suffix in (".png", ".pdf")] == before
    assert len(list(tmp_path.iterdir())) == 2


def test_a_folder_that_cannot_be_written_is_said(draw, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="Cannot write the figure"):
        save(draw()[0], tmp_path / "file" / "figure")


def png_of(figure):
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def test_threads_draw_the_same_and_leave_pyplot_and_settings_alone(draw):
    before, shown = dict(mpl.rcParams), pyplot.get_fignums()
    alone = [png_of(figure) for figure in draw()]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda _: [png_of(figure) for figure in draw()], range(2)))
    assert together == [alone] * 2
    assert dict(mpl.rcParams) == before
    assert pyplot.get_fignums() == shown
