"""The report as a browser reads it."""

import base64
import io
import json
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest
import yaml
from made_up_answers import FIVE, five
from PIL import Image

from bilateral_rl.analysis.goals import JUDGED_RADII
from bilateral_rl.analysis.intervals import Interval
from bilateral_rl.analysis.power import Design, Spread
from bilateral_rl.claims import Aside, Claim, Component, Judgement, margins
from bilateral_rl.runs.folder import versions
from bilateral_rl.study.answer_in_words import CONFIRMING, EXPLORING, opening, turns_in_words
from bilateral_rl.study.calibration import CALIBRATED
from bilateral_rl.study.grid import Grid
from bilateral_rl.study.jobs import JobOutcome, JobState
from bilateral_rl.study.plan import Study
from bilateral_rl.study.readings import load_readings
from bilateral_rl.study.report import LOG_LINES, Findings, Picture, counts_of, write_report
from bilateral_rl.study.report_table import ReportTable
from bilateral_rl.study.reproduction import metrics_shown

VOID = {"meta", "img", "br"}
BAD = "<script>alert('1 < 2 & \"so\"')</script>"


class Page(HTMLParser):
    """Elements with their attributes, and text by the elements that it stands in; refuses tags that do not close."""

    def __init__(self, path):
        super().__init__()
        self.elements, self.texts, self._open = [], [], []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()
        assert not self._open

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in VOID:
            self._open.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self._open.pop()[0] == tag

    def handle_data(self, data):
        if data.strip():
            self.texts.append((list(self._open), data.strip()))

    def text(self, tag=None, **attributes):
        """All text within elements of this kind, one a line."""
        wanted = {name.rstrip("_"): value for name, value in attributes.items()}
        return "\n".join(
            text
            for inside, text in self.texts
            if any(t == (tag or t) and wanted.items() <= a.items() for t, a in inside)
        )

    def folded(self):
        """What is folded away, by the words that are shown instead."""
        words = [text for inside, text in self.texts if inside[-1][0] in ("summary", "pre")]
        return dict(zip(words[::2], words[1::2], strict=True))


def jobs_of(study):
    return Grid(study, load_readings()).jobs(Path("nowhere"))


def component(text="completion: uni_dl > uni_ndl", verdict="supported", **values):
    fields = {
        "measured": "uni_dl 97 %",
        "quantity": "difference",
        "unit": "points",
        "test": "Welch's t test",
        "p": 0.01,
    }
    return Component(text=text, estimate=Interval(2.0, 1.0, 3.0, 10), verdict=verdict, **(fields | values))


CLAIMS = [
    Claim(
        "C1", "Reach: the first claim.", (component(), component("ratio", "undecided", test="", note="only 3 seeds"))
    ),
    Claim(
        "C2",
        f"Lesions: {BAD}",
        (component("shallow", "not supported"),),
        (Aside("bare", (component("bare", "supported"),)),),
    ),
    Claim("C3", "Hold: the third claim.", (component("hold"),)),
]


@pytest.fixture
def picture(tmp_path):
    def make(name, caption="Reach: what it shows.", size=(30, 20)):
        Image.new("RGB", size, "red").save(tmp_path / f"{name}.png")
        return Picture(tmp_path / f"{name}.png", caption)

    return make


@pytest.fixture
def page(tmp_path):
    """The page that tells of a study, its outcomes all done unless others are given."""

    def make(study=None, outcomes=None, claims=CLAIMS, tables=(), pictures=(), judgements=None, radii=JUDGED_RADII):
        study = study or Study(seeds=2)
        outcomes = outcomes or [JobOutcome(job, JobState.DONE, 90.0) for job in jobs_of(study)]
        path = tmp_path / "report.html"
        judgements = judgements or [Judgement("text", claims)]
        metrics = metrics_shown(radii)
        write_report(Findings(study, study.configs(), outcomes, judgements, tables, pictures, metrics, radii), path)
        return Page(path)

    return make


def badges(shown, number):
    """Verdicts in the section of a claim, with how they look."""
    section = ("section", {"class": "claim", "id": f"text-{number}"})
    marked = [(text, inside[-1][1].get("class", "")) for inside, text in shown.texts if section in inside]
    return [(text, look) for text, look in marked if look.startswith("verdict")]


def test_every_claim_stands_with_its_statement_parts_numbers_and_verdict(page):
    shown = page()
    for claim in CLAIMS:
        text = shown.text("section", id=f"text-{claim.number}")
        parts = [*claim.components, *(part for aside in claim.beside for part in aside.components)]
        words = [claim.statement, *(part.text for part in parts), *(part.numbers for part in parts)]
        note = f" Note: {claim.further_note}." if claim.further_note else ""
        for expected in (*words, f"Test: {claim.tests}.{note}"):
            assert expected in text
        verdicts = [part.verdict for part in (claim, *parts)]
        assert badges(shown, claim.number) == [(v, f"verdict {v.replace(' ', '-')}") for v in verdicts]


def test_what_was_chosen_for_some_claims_is_said_with_the_verdicts(page):
    words = "C1, C2, C3 are no tests"
    assert words in page().text("p")
    assert words not in page(Study(seeds=2, profile="released")).text("p")


def test_margins_lesions_and_metrics_are_explained(page):
    shown = page()
    assert f"{margins.COMPLETES:g} % or more" in shown.text("p")
    assert "a side's input is zero" in shown.text("p")
    terms = shown.text("dt").splitlines()
    assert "Effort (s)" in terms
    assert len(terms) == len(set(terms)) == len(shown.text("dd").splitlines())


def test_all_verdicts_stand_first_and_lead_to_their_claims(page):
    shown = page()
    cells = shown.text("td").splitlines()
    expected = [text for claim in CLAIMS for text in (claim.number, claim.statement, claim.verdict)]
    assert cells[: len(expected)] == expected
    links = {attributes["href"] for tag, attributes in shown.elements if tag == "a"}
    targets = {f"#{attributes['id']}" for _, attributes in shown.elements if "id" in attributes}
    assert {"#text-C1", "#text-C2", "#text-C3"} <= links <= targets
    assert "Of 3 claims: 1 supported, 1 not supported, 1 undecided." in shown.text("p")


def test_the_answer_stands_first_as_words_and_as_claims_by_readings(page):
    shown = page(judgements=FIVE)
    assert opening(five()) in shown.text("p")
    cells = shown.text("table", class_="grid").splitlines()
    assert cells[:6] == ["reading", "C1", "C2", "C3", "C4", "✓ / ✗ / ?"]
    rows = [cells[i : i + 6] for i in range(6, len(cells), 6)]
    assert rows == [
        ["“text”", "✓ +10", "✗ +20", "? +30", "✓ +40", "2 / 1 / 1"],
        ["goal of a reach: 1 cm", "✓ +10", "? +20", "? +30", "✗ +40", "1 / 1 / 2"],
        ["“everything”", "✓ +10", "✗ +20", "✓ +30", "✓ +40", "3 / 1 / 0"],
        ["epochs: 3", "✓ +10", "✗ +20", "? +30", "✓ +40", "2 / 1 / 1"],
        ["goal of a reach: 1 cm", "✓ +10", "✗ +20", "✓ +30", "✗ +40", "2 / 2 / 0"],
    ]
    titles = [attributes.get("title", "") for tag, attributes in shown.elements if tag == "td"]
    assert any(
        title.startswith("C4, not supported; 0 of 1 statements supported. Decided by a > b: a 60 %, b 50 %; diff")
        for title in titles
    )
    summary = shown.text("table", class_="summary")
    assert turns_in_words(five(), "C4") in summary
    assert "2 of 5 (3 undecided)" in summary


def test_claims_are_told_in_detail_under_each_anchor(page):
    shown = page(judgements=FIVE)
    assert [line for line in shown.text("h3").splitlines() if line.startswith("Under")] == [
        "Under the reading “text”", "Under the reading “everything”",
    ]  # fmt: skip
    ids = [attributes["id"] for tag, attributes in shown.elements if tag == "section"]
    assert ids == [f"{anchor}-C{i}" for anchor in ("text", "everything") for i in range(1, 5)]


def test_every_reading_is_explained(page):
    shown = page(judgements=FIVE)
    assert shown.text("dt").splitlines()[:5] == [judgement.reading for judgement in FIVE]
    explained = shown.text("dd")
    assert "as “everything”, but epochs: 3." in explained
    assert "Why everything-epochs. Source of everything-epochs." in explained
    assert "what adapts: output; epochs: 1; measure of a reach: completion" in explained


def test_a_state_that_is_not_above_its_control_is_said_to_be_relearned(page):
    floored = component(relearned=("deep lesion of cc_s in random_reach",))
    text = page(claims=[Claim("C6", "A claim.", (floored,))]).text("li")
    assert "Lost, or relearned and not kept: deep lesion of cc_s in random_reach – not shown to be better" in text
    assert "Relearned" not in page().text("li")


def test_an_undecided_part_says_how_many_seeds_it_takes(page):
    design = Design("direction", 1.0, (Spread(4.0, 5),))
    text = page(claims=[Claim("C6", "A claim.", (component(verdict="undecided", design=design),))]).text("li")
    assert "p = 0.010. Undecidable at this cost: it takes more than 50 seeds." in text


def test_what_the_seeds_are_for_is_said(page):
    assert EXPLORING in page().text("p")
    text = page(Study(seeds=2, first_seed=100)).text("p")
    assert CONFIRMING in text
    assert EXPLORING not in text


def test_curves_of_claims_are_folded_away_in_the_answer(page, picture):
    shown = page(judgements=FIVE, pictures=[picture("curve_C3", "C3 under 2 readings."), picture("speed_random_reach")])
    assert shown.text("summary").splitlines()[0] == "C3 under 2 readings."
    assert len([tag for tag, _ in shown.elements if tag == "img"]) == 2


def test_columns_of_words_are_told_from_columns_of_numbers(page):
    table = ReportTable("t", "Title", ["", "seeds", "for"], [["C1", "34", "a long sentence"]], of_words=(2,))
    shown = page(tables=[table])
    looks = [inside[-1][1].get("class") for inside, text in shown.texts if text in ("34", "a long sentence")]
    assert looks == ["number", "words"]


def test_wide_tables_scroll_in_a_box_of_their_own(page):
    table = ReportTable("t", "Title", ["", "a"], [["C1", "1"]])
    shown = page(tables=[table], judgements=FIVE)
    opened = [attributes.get("class", "") for tag, attributes in shown.elements if tag in ("div", "table")]
    around = {name: before for before, name in pairwise(opened)}
    assert around["data"] == around["grid"] == around["summary"] == "scroll"


def test_verdicts_are_counted():
    assert counts_of(CLAIMS[:1] * 2) == "Of 2 claims: 0 supported, 0 not supported, 2 undecided."


def test_the_page_needs_nothing_from_outside(page, picture):
    shown = page(pictures=[picture("models_random_reach"), picture("paths_random_reach_cc_s")])
    tags = {tag for tag, _ in shown.elements}
    assert not tags & {"script", "link", "iframe", "object", "embed", "base", "audio", "video", "source", "svg"}
    for _, attributes in shown.elements:
        for name, value in attributes.items():
            assert not name.startswith("on")
            if name in ("src", "href", "srcset", "action", "data", "background", "style"):
                assert value.startswith(("#", "data:image/png;base64,")), value
    assert "url(" not in shown.text("style")
    assert "@import" not in shown.text("style")


def test_pictures_are_in_the_page_each_once_with_its_caption(page, picture):
    names = ["models_random_reach", "paths_random_reach_cc_s", "paths_random_reach_bi_s", "paths_hold_position_cc_s"]
    captions = ["Reach: models.", "Reach: paths of CC-S.", "Reach: paths of Bi-S.", "Hold: paths of CC-S."]
    pictures = [picture(*values, (10 + i, 20)) for i, values in enumerate(zip(names, captions, strict=True))]
    shown = page(pictures=pictures)
    images = [attributes for tag, attributes in shown.elements if tag == "img"]
    assert [image["alt"] for image in images] == captions
    for i, image in enumerate(images):
        decoded = Image.open(io.BytesIO(base64.b64decode(image["src"].partition(",")[2], validate=True)))
        assert decoded.format == "PNG"
        assert decoded.size == (10 + i, 20)
    assert shown.text("figcaption").splitlines() == captions
    assert [line for line in shown.text("h3").splitlines() if "hand paths" in line] == [
        "Reach: hand paths",
        "Hold: hand paths",
    ]


def test_tables_are_shown_whole(page):
    table = ReportTable("t", "A < title", ["", "Uni-B"], [["Effort (s)", "1 ± 2"], ["p", "< 0.001"]], "A & note.")
    shown = page(tables=[table])
    assert "A < title" in shown.text("h3")
    assert "A & note." in shown.text("p")
    cells = shown.text("td").splitlines()
    assert [cell for cell in cells if cell in {"Effort (s)", "1 ± 2", "p", "< 0.001"}] == [
        "Effort (s)", "1 ± 2", "p", "< 0.001",
    ]  # fmt: skip


def test_only_a_preview_says_that_it_is_one(page):
    (banner,) = page(Study(seeds=3, quick=True)).text(class_="preview").splitlines()
    assert banner == "Preview: 3 seeds, short trainings and few test trials. No number here is a result."
    assert "Preview" not in "\n".join(text for _, text in page(Study(seeds=3)).texts)


def test_a_failed_training_is_shown_with_its_error_and_the_end_of_its_log(page, tmp_path):
    study = Study(seeds=2)
    jobs = jobs_of(study)
    log = tmp_path / "log"
    log.write_bytes("\n".join([f"line {i}" for i in range(40)] + [BAD, "\x1b[31m end"]).encode() + b"\xff")
    outcomes = [JobOutcome(job, JobState.DONE, 90.0, log=log) for job in jobs]
    outcomes[3] = JobOutcome(jobs[3], JobState.FAILED, 30.0, f"ValueError: {BAD}", log)
    outcomes[4] = JobOutcome(jobs[4], JobState.DONE)
    outcomes[5] = JobOutcome(jobs[5], JobState.FAILED, 3.0, "killed", None)
    outcomes[6] = JobOutcome(jobs[6], JobState.FAILED, 3.0, "killed", tmp_path / "gone")
    shown = page(study, outcomes, claims=CLAIMS[:1])
    text = shown.text("td")
    assert f"Random reach, Bi-NS\nfailed\n0.5\nValueError: {BAD}\n" in text
    assert "Random reach, Bi-S\ndone\nbefore\n" in text
    assert "Random reach, CC-NS\nfailed\n" in text
    logs = {words: text for words, text in shown.folded().items() if "log" in words}
    assert list(logs) == ["The end of the log of Random reach, Bi-NS"]
    lines = logs["The end of the log of Random reach, Bi-NS"].splitlines()
    assert lines[: LOG_LINES - 2] == [f"line {i}" for i in range(42 - LOG_LINES, 40)]
    assert lines[-2] == BAD
    assert lines[-1].endswith("end\N{REPLACEMENT CHARACTER}")
    assert "11 of 14 trainings are done, each of 2 networks. The others are missing" in shown.text("p")


def test_nothing_that_is_reported_can_act_as_markup(page, tmp_path):
    study = Study(seeds=2)
    log = tmp_path / "log"
    log.write_text(BAD)
    outcomes = [JobOutcome(job, JobState.FAILED, 1.0, BAD, log) for job in jobs_of(study)]
    shown = page(study, outcomes, tables=[ReportTable(BAD, BAD, [BAD, BAD], [[BAD, BAD]], BAD)])
    assert "script" not in {tag for tag, _ in shown.elements}
    assert sum(text.count(BAD) for _, text in shown.texts) == 2 * 14 + 6 + 2  # jobs, table, a claim in two places


def test_runs_of_one_seed_each_are_named_by_it(page):
    study = Study(algo="ppo", seeds=2)
    names = [text for inside, text in page(study).texts if inside[-1][0] == "td" and "seed" in text]
    assert names[:2] == ["Random reach, Uni-B, seed 0", "Random reach, Uni-B, seed 1"]
    assert len(names) == 28


def test_configuration_and_versions_are_exact(page):
    study = Study(seeds=2, overrides={"epochs": 3})
    blocks = page(study, claims=CLAIMS[:1]).folded()
    assert yaml.safe_load(blocks["The study"]) == study.to_values()
    for task, words in (("random_reach", "Random reach"), ("hold_position", "Hold position")):
        (config,) = [c for c in study.configs() if (c.task, c.model) == (task, "cc_s")]
        assert yaml.safe_load(blocks[f"Settings of {words}, CC-S"]) == config.to_values()
    assert json.loads(blocks["Versions"]) == versions()


def test_what_was_calibrated_is_said_where_it_was(page, monkeypatch):
    words = "C4 to C14 are tests of that choice"
    assert words in page(Study(seeds=2)).text("p")
    assert words not in page(Study(seeds=2, profile="released")).text("p")
    assert "profile released, 2 seeds each" in page(Study(seeds=2, profile="released")).text("p")
    assert "profile" not in page(Study(algo="ppo", seeds=2)).text("p", class_="faint").splitlines()[0]
    assert "radii of the goals, was chosen" in page(Study(seeds=2)).text("p")
    monkeypatch.setitem(CALIBRATED, "sac", {"random_reach": 0.1, "hold_position": 0.2})
    assert "its kind and the radii of the goals by bptt, was chosen" in page(Study(algo="sac", seeds=2)).text("p")


def test_radii_are_those_of_tables_and_figures_and_a_reading_names_them(page):
    radii = {"random_reach": 0.02, "hold_position": 0.03}
    assert "Goal radius: reach 2 cm, hold 3 cm." in page(radii=radii).text("p")
    two = [Judgement(name, CLAIMS) for name in ("mine", "text")]
    assert "Goal radius under “mine”: reach 2 cm, hold 3 cm." in page(radii=radii, judgements=two).text("p")


def test_a_training_is_told_by_its_settings_as_they_are_written(page, tmp_path):
    study, path = Study(seeds=2), tmp_path / "mine.yaml"
    training = {"bptt": {"penalty_coefficient": 0.00002}}
    path.write_text(yaml.safe_dump({"why": "Because.", "source": "Nowhere.", "training": training}))
    jobs = Grid(study, load_readings([str(path)])).jobs(Path("nowhere"))
    shown = page(study, [JobOutcome(job, JobState.DONE, 90.0) for job in jobs]).text("td")
    assert "Random reach, Uni-DL, bptt.penalty_coefficient=2e-05" in shown
    assert "2e 05" not in shown
