"""Any network of any run as a policy of stable-baselines3, whatever trained it."""

from stable_baselines3.common.evaluation import evaluate_policy

import bilateral_rl as brl

# A run to load. If you have one, brl.load("runs/random_reach/cc_s-bptt-1:3") is its network of seed 3.
run = brl.train("bptt", epochs=1, settings={"bptt.trials": 640}, out="runs/examples", progress=False)

policy = run.policy()
env = brl.envs.ArmVecEnv(8, "random_reach", seed=0)
action, _ = policy.predict(env.reset(), deterministic=True)
print("actions of eight arms:", action.shape)

with policy.motor_network.lesioned("deep_non_dominant"):
    print("the dominant hemisphere alone:", evaluate_policy(policy, env, n_eval_episodes=64, warn=False))
