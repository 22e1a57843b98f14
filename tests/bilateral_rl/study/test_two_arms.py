"""The study of two arms: its trainings, its readings, and what follows from made-up results."""

import pandas as pd
import pytest
import yaml
from made_up_hands import World

from bilateral_rl.config.parse import build
from bilateral_rl.config.resolve import resolve
from bilateral_rl.io.errors import UserError
from bilateral_rl.study.fit import readings_for
from bilateral_rl.study.grid import Grid
from bilateral_rl.study.jobs import JobOutcome, JobState
from bilateral_rl.study.lesioning import LesionSettings, with_spring
from bilateral_rl.study.plan import TASKS_OF, Study
from bilateral_rl.study.reproduction import conclude
from bilateral_rl.study.two_arms.readings import HAND_FILES, usual_readings

FOUR = ("bi_ns", "bi_s", "cc_ns", "cc_s")
PENALTIES = {"penalty-0.001", "penalty-0.00003", "penalty-none"}
NEED_TRAININGS = PENALTIES | {"share-0", "share-0.3", "trained-combination", "units-10", "spring-0", "spring-100"}


def grid(readings=None, **study):
    made = Study(**{"subject": "two_arms", "models": FOUR, "seeds": 10} | study)
    return Grid(made, readings_for(made, readings)[0])


def test_a_study_of_two_arms_has_its_own_tasks_and_folder():
    study = Study(subject="two_arms", models=FOUR, seeds=2)
    assert {(c.task, c.model) for c in study.configs()} == {(t, m) for t in TASKS_OF["two_arms"] for m in FOUR}
    assert {config.network.units for config in study.configs()} == {20}
    assert study.name == "reproduce-two_arms-bptt-paper-bi_ns-bi_s-cc_ns-cc_s"
    some = Study(subject="two_arms", tasks=("two_holds", "reach_and_hold"), algo="ppo")
    assert some.tasks == ("reach_and_hold", "two_holds")
    assert some.name == "reproduce-two_arms-ppo-paper-reach_and_hold-two_holds"
    assert not study.is_calibrated
    assert yaml.safe_load(yaml.safe_dump(study.to_values())) == study.to_values()


def test_of_the_paper_too_some_tasks_can_be_chosen():
    assert {config.task for config in Study(tasks=("hold_position",)).configs()} == {"hold_position"}
    with pytest.raises(UserError, match="Unknown task of the study paper 'two_holds'"):
        Study(tasks=("two_holds",))


def test_by_default_all_readings_share_the_trainings():
    assert {reading.name for reading in HAND_FILES.load(["all"])} - set(usual_readings()) == NEED_TRAININGS
    assert {training.name for training in grid().tables} == {"base"}
    assert len(grid().tables) == 3 * len(FOUR)
    assert grid().readings[0].name == "default"


def test_every_other_reading_deviates_from_the_default_by_one_choice():
    default, *others = HAND_FILES.load(["all"])
    for reading in others:
        assert reading.anchor == "default"
        different = [name for name, choice in reading.choices.items() if choice != default.choices[name]]
        assert len(different) == 1, reading.name


def test_networks_are_tested_with_the_spring_and_without_after_lesions_that_claims_are_about():
    of = {(t.training.config.task, t.training.config.model): set() for t in grid(["default"]).all_tables}
    for table in grid(["default"]).all_tables:
        settings = build(LesionSettings, table.settings)
        of[table.training.config.task, table.training.config.model].add(table.name)
        assert settings.spring == table.spring
        assert "shallow_dominant" not in settings.lesions
        assert ("callosum" in settings.lesions) == table.training.config.model.startswith("cc")
    assert of["reach_and_hold", "bi_s"] == {"none-spring-50", "none-spring-0"}
    assert of["reach_and_hold", "cc_s"] == {
        f"{name}-spring-{k}" for name in ("none", "output-lr-0.001") for k in (50, 0)
    }
    assert of["two_reaches", "cc_s"] == of["two_holds", "bi_ns"] == {"none-spring-0"}


def test_a_reading_trains_with_another_spring_and_sets_it_against_none():
    of = {name: grid([name], tasks=("reach_and_hold",), models=("cc_s",)) for name in ("spring-0", "spring-100")}
    springs = {name: {table.spring for table in made.all_tables} for name, made in of.items()}
    assert springs == {"spring-0": {0.0, 50.0}, "spring-100": {100.0, 0.0}}
    (training,) = of["spring-100"].tables
    criteria = of["spring-100"].readings[0].criteria(training.config)
    assert (criteria.spring, criteria.tied, criteria.has_path) == (100, 100, True)


def test_what_divides_hemispheres_is_not_asked_of_one_network():
    made = grid(["default", "share-0"], models=("uni_b", "cc_s"), tasks=("reach_and_hold",))
    names = sorted(training.job_name for training in made.tables)
    assert names == [
        "reach_and_hold/cc_s",
        "reach_and_hold/cc_s-network.ipsilateral_share=0.0",
        "reach_and_hold/uni_b",
    ]
    (other,) = (t for t in made.tables if t.config.network.ipsilateral_share == 0)
    assert not made.readings[1].criteria(other.config).has_path


def test_readings_change_the_trainings_of_any_algorithm_but_by_its_own_settings():
    study = Study(subject="two_arms", algo="ppo")
    assert set(readings_for(study, ["all"])[1]) == PENALTIES
    with pytest.raises(UserError, match="penalty-none changes the training by bptt, and this study trains by ppo"):
        grid(["penalty-none"], algo="ppo")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"why": ""}, "why is missing"),
        ({"straightness": "grace"}, "Unknown straightness 'grace'"),
        ({"deep": {"retrain": "all"}}, "Unknown deep.retrain 'all'"),
        ({"training": {"reach_and_hold": 3}}, "training.reach_and_hold must be settings by name"),
        ({"training": {"seeds": 3}}, "cannot change seeds"),
    ],
)
def test_a_file_that_holds_no_reading_of_two_arms_is_refused(tmp_path, values, message):
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump({"why": "Because.", "source": "Nowhere."} | values))
    with pytest.raises(UserError, match=message):
        grid([str(path)])


def fill(folder, made, world):
    """The results of every table of a grid."""
    results = world.results()
    for table in made.all_tables:
        config = table.training.config
        rows = results[table.spring]
        rows = rows[(rows["task"] == config.task) & (rows["model"] == config.model)]
        path = folder / table.path
        path.parent.mkdir(parents=True, exist_ok=True)
        rows[rows["protocol"] == table.protocol.name].to_csv(path, index=False)
    return [JobOutcome(job, JobState.DONE) for job in made.jobs(folder)]


@pytest.fixture(scope="module")
def concluded(tmp_path_factory):
    """A study of made-up results that bear out every claim; a seed of one model never learned."""
    folder, world, made = tmp_path_factory.mktemp("study"), World(), grid(["default"])
    world.tasks, world.stuck, world.retrained = TASKS_OF["two_arms"], {"cc_s": (4,)}, "output-lr-0.001"
    return folder, conclude(made, folder, fill(folder, made, world))


def test_claims_are_judged_by_every_reading(concluded):
    folder, judgements = concluded
    assert [judgement.reading for judgement in judgements] == ["default"]
    for judgement in judgements:
        assert judgement.note == (
            "1 of 40 networks complete less than 50 % of their reaches; never learned and left out, by seed: cc_s 4"
        )
        assert {claim.number: claim.verdict for claim in judgement.claims} == dict.fromkeys(
            ["B1", "B2", "B3", "B4", "B5", "B6"], "supported"
        )
    answer = pd.read_csv(folder / "answer.csv")
    assert list(answer["verdict"]) == ["supported"] * 6
    assert {"spring", "training"} <= set(pd.read_csv(folder / "results.csv").columns)


def test_tables_tell_hands_roles_arms_and_who_never_learned(concluded):
    tables = {path.stem: pd.read_csv(path) for path in (concluded[0] / "tables").glob("*.csv")}
    assert {"hands_reach_and_hold_reach", "hands_reach_and_hold_hold", "hands_two_reaches_reach"} <= set(tables)
    learned = tables["learned"].set_index(tables["learned"].columns[0])
    assert learned.loc["Reach and hold, CC-S"].astype(str).tolist() == ["10", "1", "4"]
    assert learned.loc["Reach and hold, Bi-S"].astype(str).tolist() == ["10", "0", "–"]
    roles = tables["roles"].set_index(tables["roles"].columns[0])
    assert roles.loc["CC-S", "interaction"].startswith("+20")
    assert abs(float(roles.loc["Bi-NS", "interaction"].split()[0])) < 0.5
    arms = tables["arms"].iloc[:, 0]
    assert "CC-S, deep dominant: dominant hand (contralesional)" in set(arms)
    assert "CC-S, deep dominant: non-dominant hand (ipsilesional)" in set(arms)


def test_figures_show_hands_roles_and_arms(concluded):
    there = {path.stem for path in (concluded[0] / "figures").glob("*.png")}
    assert {"hands_and_roles", "roles_interaction", "arms_after_lesions"} <= there


def test_the_report_tells_what_claims_rest_on(concluded):
    page = (concluded[0] / "report.html").read_text()
    assert "Two arms, one brain" in page
    assert "never learned and left out, by seed: cc_s 4" in page
    assert "The paper leaves open" not in page


def test_where_no_network_learned_that_comes_first_and_nothing_empty_is_drawn(tmp_path):
    world, made = World(), grid(["default", "drift"], models=("bi_ns", "bi_s"), tasks=("reach_and_hold",))
    world.stuck = {"bi_ns": range(10), "bi_s": range(10)}
    judgements = conclude(made, tmp_path, fill(tmp_path, made, world))
    page = (tmp_path / "report.html").read_text()
    answer = page.partition('<h2 id="answer">')[2]
    assert answer.index("20 of 20 networks complete less than 50 % of their reaches: train longer") < answer.index(
        "No claim can be judged"
    )
    assert "No claim holds" not in page
    assert "no single choice" not in page
    assert list(tmp_path.glob("figures/*")) == []
    notes = [component.note for component in judgements[0].claims[0].components]
    assert notes == [
        "never learned and left out, by seed: bi_s " + ", ".join(map(str, range(10))),
        "not among the study's models: cc_s",
    ]


def test_one_arm_has_no_spring_between_hands():
    config = resolve("bptt", "reach_and_hold")
    other = with_spring(config, 0.0)
    assert (config.trial.two_arms.spring.stiffness, other.trial.two_arms.spring.stiffness) == (50, 0)
    assert with_spring(config, None) is config
    with pytest.raises(UserError, match="random_reach is a task of one arm"):
        with_spring(resolve("bptt", "random_reach"), 50.0)
