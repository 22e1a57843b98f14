"""Each hemisphere by its own reward: callbacks, save, load, go on, lesions."""

import torch
from stable_baselines3.common.callbacks import CheckpointCallback, EvalCallback
from stable_baselines3.common.evaluation import evaluate_policy

from bilateral_rl.algorithms import HemisphericPPO
from bilateral_rl.envs import ArmVecEnv

ARMS = 256
STEPS = 51_200  # four rollouts; learning to hold takes hundreds

torch.set_num_threads(1)  # networks this small only lose time to a second thread

# Hold the hand where it is, against a load of up to 5 N along each axis.
env = ArmVecEnv(ARMS, "hold_position", max_load=5.0)
test_env = ArmVecEnv(64, "hold_position", max_load=5.0, seed=1)

callbacks = [  # SB3 counts a step of all 256 arms as one
    EvalCallback(test_env, n_eval_episodes=64, eval_freq=100, best_model_save_path="best", verbose=0),
    CheckpointCallback(save_freq=100, save_path="checkpoints"),
]

# Most arguments are SB3's. loss="combined" would train all of the network by both rewards.
model = HemisphericPPO(
    "CallosalPolicy",
    env,
    loss="specialized",
    n_steps=50,
    batch_size=2560,
    n_epochs=5,
    tensorboard_log="logs",
    device="cpu",
)
model.learn(STEPS, callback=callbacks)
model.save("hold")

# SB3's own file, loaded again; `bilateral-rl import hold.zip --trust-pickle --task hold_position` makes a run of it.
model = HemisphericPPO.load("hold", env=env)
model.learn(STEPS // 2, reset_num_timesteps=False)

network = model.policy.motor_network
print("how much each side counts:", network.combination_weights())
for lesion in ("intact", *network.available_lesions()):
    with network.lesioned(lesion):
        mean, deviation = evaluate_policy(model, test_env, n_eval_episodes=64, warn=False)
    print(f"{lesion:30} return {mean:7.1f} ± {deviation:.1f}")
