"""Every lesion of trained networks as a table of pandas, and a figure."""

from pathlib import Path

from bilateral_rl.analysis.metrics import find_metric
from bilateral_rl.config.resolve import resolve
from bilateral_rl.figures.lesions import lesion_effects
from bilateral_rl.figures.saving import save
from bilateral_rl.study.lesioning import LesionSettings, LesionStudy
from bilateral_rl.training.run import train

SEEDS, EPOCHS, TRIALS = 3, 2, 640  # the paper: 10, 100, 6400
TESTS = 128  # trials of each test; the commands take 1024

# A run to lesion; RunFolder.open("runs/random_reach/cc_s-bptt-1") is one that you have.
settings = {"seeds": SEEDS, "epochs": EPOCHS, "bptt": {"trials": TRIALS}}
run = train(resolve("bptt", "random_reach", [settings], model="cc_s"), Path("runs/examples")).folder

# Intact and seven lesions: not retrained, the output layer retrained for an epoch, or everything. One row a value; its
# columns are model, task, algo, seed, lesion, network ("fresh": the control, which had learned nothing), protocol, what
# that comes to in numbers, metric and value. `bilateral-rl lesion` writes this table as lesions.csv.
study = LesionStudy(run, LesionSettings(trials=TESTS, retraining_trials=TRIALS))
results = study.run()

metric = find_metric("goal_completion_5cm")
rows = results[(results["metric"] == metric.name) & (results["network"] == "trained")]
table = rows.pivot_table(index="lesion", columns="protocol", values="value", aggfunc=["mean", "std"], sort=False)
print(f"{metric.label} ({metric.unit})", table.round(1), sep="\n")

# What is left when one hemisphere works alone is what the other one's deep lesion leaves.
alone = {"dominant": "deep_non_dominant", "non-dominant": "deep_dominant"}
for side, lesion in alone.items():
    seeds = rows[(rows["lesion"] == lesion) & (rows["protocol"] == "everything")].set_index("seed")["value"]
    print(f"the {side} hemisphere alone, everything retrained, by seed: {seeds.round(1).to_dict()}")

for file in save(lesion_effects(results, "random_reach", metric, ["cc_s"]), Path("lesion_study")):
    print("saved", file)
