"""Any network of any run as a policy of stable-baselines3, whatever trained it."""

from pathlib import Path

from stable_baselines3.common.evaluation import evaluate_policy

from bilateral_rl.config.resolve import resolve
from bilateral_rl.envs import ArmVecEnv
from bilateral_rl.runs.policies import load_policy
from bilateral_rl.training.run import train

# A run to load. Leave this out if you have one: RUN = "runs/random_reach/cc_s-bptt-1:3" is its network of seed 3.
config = resolve("bptt", "random_reach", [{"epochs": 1, "bptt": {"trials": 640}}], model="cc_s")
RUN = train(config, Path("runs/examples")).folder.path

policy = load_policy(RUN)
env = ArmVecEnv(8, "random_reach", seed=0)
action, _ = policy.predict(env.reset(), deterministic=True)
print("actions of eight arms:", action.shape)

with policy.motor_network.lesioned("deep_non_dominant"):
    print("the dominant hemisphere alone:", evaluate_policy(policy, env, n_eval_episodes=64, warn=False))
