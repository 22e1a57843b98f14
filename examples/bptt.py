"""The paper's supervised training from Python: three networks at once, and their learning curves."""

from pathlib import Path

import pandas as pd

from bilateral_rl.analysis.trials import Evaluator
from bilateral_rl.config.resolve import resolve
from bilateral_rl.training.run import train

SEEDS = 3  # the paper: 10
EPOCHS = 2  # the paper: at most 100, and it stops early
TRIALS = 640  # the paper: 6400, drawn once and shown again in every epoch

# The entries of config.yaml, over the defaults of the algorithm and the task. With the paper's numbers this takes about
# five minutes, and the networks complete 92.9 ± 3.7 % of their reaches.
settings = {"seeds": SEEDS, "epochs": EPOCHS, "bptt": {"trials": TRIALS}}
config = resolve("bptt", "random_reach", [settings], model="cc_s")

# Losses and gradients go through the arm. Each network ends as it would have ended alone.
outcome = train(config, Path("runs/examples"))
print("saved in", outcome.folder.path)

# Losses, gradient norms and measures on the validation trials, one row for each seed and epoch.
epochs = pd.read_csv(outcome.folder.path / "epochs.csv")
print(epochs.drop(columns="seed").groupby("epoch").mean().T)

# New trials for each network. A record holds every step: hand, target, excitation, activation and more.
evaluator = Evaluator(config.task, config.trial, trials=256, seed=0)
for seed, policy in outcome.policies.items():
    record = evaluator.run(policy)
    completed = record.summary(radius=0.05)["goal_completion_percent"]
    print(f"seed {seed}: {completed:.0f} % of reaches completed; the hand's path has shape {record.hand.shape}")
