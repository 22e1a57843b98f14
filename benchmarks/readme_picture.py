"""The README's picture: a trained run's arm in the middle of a reach, and hand paths of twelve trials."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.envs import ArmEnv
from bilateral_rl.figures import as_array, hand_paths
from bilateral_rl.policies import BilateralActorCriticPolicy
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import load_policy

HEIGHT = 480


def arm_in_motion(policy: BilateralActorCriticPolicy, task: str, seed: int, steps: int) -> Image.Image:
    env = ArmEnv(task, render_mode="rgb_array")
    observation, _ = env.reset(seed=seed)
    for _ in range(steps):
        action, _ = policy.predict(observation, deterministic=True)
        observation, *_ = env.step(action)
    picture = env.render()
    assert picture is not None
    return Image.fromarray(picture)


def main(run: Path, out: Path, seed: int = 11, steps: int = 14) -> None:
    folder = RunFolder.open(run)
    config, policy = folder.config(), load_policy(folder)
    record = Evaluator(config.make_task(), config.trial, 12, seed).run(policy)
    paths = Image.fromarray(as_array(hand_paths(record, config.trial.threshold, sum(config.trial.arm.link_length))))
    paths = paths.resize((round(paths.width * HEIGHT / paths.height), HEIGHT), Image.Resampling.LANCZOS)
    both = [np.asarray(arm_in_motion(policy, config.task, seed, steps)), np.asarray(paths)]
    Image.fromarray(np.concatenate(both, axis=1)).quantize(256).save(out, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
