"""The paper's supervised training from Python: three networks at once, and their learning curves."""

import bilateral_rl as brl

SEEDS = 3  # the paper: 10
EPOCHS = 2  # the paper: at most 100, and it stops early
TRIALS = 640  # the paper: 6400, drawn once and shown again in every epoch

# Losses and gradients go through the arm. Each network ends as it would have ended alone. With the paper's numbers this
# takes about five minutes, and the networks complete 92.9 ± 3.7 % of their reaches.
run = brl.train("bptt", "cc_s", seeds=SEEDS, epochs=EPOCHS, settings={"bptt.trials": TRIALS}, out="runs/examples")
print("saved in", run.path)

# Losses, gradient norms and measures on the validation trials, one row for each seed and epoch.
print(run.curves().groupby("epoch").mean(numeric_only=True).drop(columns="seed").T)

# New trials for each network: means over the trials, for goals of several radii.
table = run.evaluate(trials=256, seed=0)
print(table[table["threshold_m"] == 0.05].set_index("seed")[["goal_completion_percent", "final_error_cm"]])
