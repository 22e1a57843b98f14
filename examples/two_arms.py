"""Two arms and one brain: a hand reaches while the other one holds, and what each arm loses with a hemisphere."""

import numpy as np
import torch

from bilateral_rl.algorithms import HemisphericPPO
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.vocabulary import SIDES

ARMS = 128
STEPS = 12_800  # two rollouts; learning takes about a thousand times as many

torch.set_num_threads(1)  # networks this small only lose time to a second thread

# One hand, drawn in each trial, reaches 10 to 20 cm; a spring of 50 N/m ties it to the other one, which is to stay.
env = ArmVecEnv(ARMS, "reach_and_hold")
model = HemisphericPPO(
    "CallosalPolicy",
    env,
    n_steps=50,
    batch_size=1280,
    policy_kwargs={"n_arms": 2, "units": 20, "ipsilateral_share": 0.15},
    device="cpu",
)
model.learn(STEPS)


def final_errors(lesion):
    """Distances of both hands from their targets at the end (n, 2) (m), dominant first, in trials that are the same."""
    test_env = ArmVecEnv(ARMS, "reach_and_hold", seed=1)
    observation = test_env.reset()
    with model.policy.motor_network.lesioned(lesion):
        for _ in range(test_env.settings.trial_length):
            action, _ = model.predict(observation, deterministic=True)
            observation, _, _, infos = test_env.step(action)
    return np.array([info["final_error"] for info in infos])


intact = final_errors("intact")
for lost in SIDES:
    change = 100 * (final_errors(f"deep_{lost}") - intact).mean(axis=0)  # (2,)
    # The dominant hemisphere moves the dominant arm, which lies on the other side of the body.
    arms = {side: "contralesional" if side == lost else "ipsilesional" for side in SIDES}
    words = (f"{arms[side]} arm {change[i]:+.1f} cm" for i, side in enumerate(SIDES))
    print(f"deep lesion, {lost.replace('_', '-')} side: {', '.join(words)}")
