"""Every lesion of trained networks as a table of pandas, tests, and a figure."""

import matplotlib.pyplot as plt

import bilateral_rl as brl

SEEDS, EPOCHS, TRIALS = 3, 2, 640  # the paper: 10, 100, 6400
TESTS = 128  # trials of each test; the commands take 1024

# Runs to lesion. If you have one, brl.load("runs/random_reach/cc_s-bptt-1") is that.
run = brl.train("bptt", "cc_s", epochs=EPOCHS, seeds=SEEDS, settings={"bptt.trials": TRIALS}, out="runs/examples")

# Intact and seven lesions: not retrained, or with everything retrained for an epoch of the training's number of trials.
# One row a value; "fresh" networks are the control, which had learned nothing.
results = run.lesion(retrain=["none", "everything"], trials=TESTS)
rows = results.query("metric == 'goal_completion_5cm' and network == 'trained'")
table = rows.pivot_table(index="lesion", columns="protocol", values="value", aggfunc=["mean", "std"], sort=False)
print("Goal completion within 5 cm (%)", table.round(1), sep="\n")

# What is left when one hemisphere works alone is what the other one's deep lesion leaves.
alone = {"dominant": "deep_non_dominant", "non-dominant": "deep_dominant"}
for side, lesion in alone.items():
    seeds = rows[(rows["lesion"] == lesion) & (rows["protocol"] == "everything")].set_index("seed")["value"]
    print(f"the {side} hemisphere alone, everything retrained, by seed: {seeds.round(1).to_dict()}")

# Each lesion against each other, paired by seed, adjusted for all pairs.
pairs = brl.compare(results, retrain="everything").pairs
print(pairs[["first", "second", "difference", "p_holm"]].round(3).head())

figure, axis = plt.subplots(figsize=(8, 4), layout="constrained")
brl.plot_lesions(results, ax=axis)
figure.savefig("lesion_study.png")
