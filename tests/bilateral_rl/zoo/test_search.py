"""Optuna through rl_zoo3 finds hyperparameters of the hemispheric algorithms."""

import pytest

from bilateral_rl.io.errors import UserError
from bilateral_rl.zoo import ZOO_ALGORITHMS

optuna = pytest.importorskip("optuna")
pytest.importorskip("rl_zoo3")
pytestmark = pytest.mark.filterwarnings("ignore:You have specified a mini-batch size")

QUICK = "--eval-freq -1 --n-trials 2 --n-evaluations 1 --eval-episodes 1 --no-optim-plots -params n_envs:4"


@pytest.mark.parametrize("algo", ["hemispheric_ppo", "hemispheric_td3"])
def test_a_search_and_a_training_with_what_it_found(algo, zoo, tmp_path):
    steps = f"--algo {algo} --env bilateral_rl/RandomReach-v0 -n 120 --storage found.log --study-name it"
    off_policy = "" if algo == "hemispheric_ppo" else "learning_starts:80"
    said = zoo(f"train {steps} -optimize {QUICK} {off_policy}")
    assert "Number of finished trials:  2" in said
    backend = optuna.storages.journal.JournalFileBackend("found.log")
    study = optuna.load_study(study_name="it", storage=optuna.storages.JournalStorage(backend))
    assert [trial.state.name for trial in study.trials] == ["COMPLETE", "COMPLETE"]
    assert study.trials[0].params != study.trials[1].params
    assert all(trial.value < 0 for trial in study.trials)
    zoo(f"train {steps} --trial-id 1 --eval-freq -1 -params n_envs:4 {off_policy}")
    (model_file,) = (tmp_path / "logs" / algo).glob("*_2/*.zip")
    model = ZOO_ALGORITHMS[algo].load(model_file, device="cpu")
    found = study.trials[1].params
    assert model.gamma == pytest.approx(1 - found["one_minus_gamma"])
    assert model.reward_scale == found["reward_scale"]
    assert model.lr_schedule(1.0) == pytest.approx(found["learning_rate"])
    if algo == "hemispheric_ppo":
        assert model.lr_schedule(0.0) == 0.0
        assert model.ent_coef(1.0) == pytest.approx(found["ent_coef"])
    else:
        assert model.action_noise.base_noise._sigma == pytest.approx([found["noise_std"]] * 6)


@pytest.mark.parametrize("algo", ZOO_ALGORITHMS)
def test_an_algorithm_takes_whatever_is_suggested(algo):
    from bilateral_rl.envs import ArmVecEnv
    from bilateral_rl.zoo.search_spaces import CONVERTERS, SAMPLERS

    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    for _ in range(5):
        trial = study.ask()
        suggested = SAMPLERS[algo](trial, 6, 2, {})
        model = ZOO_ALGORITHMS[algo]("CallosalPolicy", ArmVecEnv(2), device="cpu", **suggested)
        from_file = CONVERTERS[algo](trial.params)
        assert 0.9 <= from_file["gamma"] == model.gamma < 1
        assert set(from_file) - {"noise_std", "noise_type", "use_rms_prop"} <= set(vars(model))


def test_a_stock_algorithm_with_our_policy_is_searched_as_its_hemispheric_one(zoo):
    with pytest.raises(UserError, match="search with --algo hemispheric_ppo"):
        zoo(f"train --algo ppo --env bilateral_rl/RandomReach-v0 -n 120 -optimize {QUICK}")
