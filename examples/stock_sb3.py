"""A callosal network in stock PPO of stable-baselines3, and what it does without its callosum."""

from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy

import bilateral_rl  # makes the names of policies and environments known

ARMS = 256
STEPS = 25_600  # two rollouts; learning to reach takes hundreds

# One environment simulates all its arms at once. A goal of 3 cm, and noise on the muscles' excitations.
env = bilateral_rl.envs.ArmVecEnv(ARMS, "random_reach", threshold=0.03, motor_noise=0.05)
model = PPO("CallosalPolicy", env, n_steps=50, batch_size=2560, policy_kwargs={"units": 20}, device="cpu")
model.learn(STEPS)

# Mean and standard deviation of the return over new trials, intact and without the callosum.
test_env = bilateral_rl.envs.ArmVecEnv(64, "random_reach", seed=1)
print("intact:", evaluate_policy(model, test_env, n_eval_episodes=64, warn=False))
with model.policy.motor_network.lesioned("callosum"):
    print("without the callosum:", evaluate_policy(model, test_env, n_eval_episodes=64, warn=False))
