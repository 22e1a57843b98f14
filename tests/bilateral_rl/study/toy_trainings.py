"""Work for the tests: a small training."""

import time

from toy_jobs import note

from bilateral_rl.config.resolve import resolve
from bilateral_rl.training.progress import Progress
from bilateral_rl.training.run import train


class _Noting(Progress):
    """Notes the end of every epoch, and lets the job's supervisor know; each epoch takes a while longer."""

    def __init__(self, shared, name, progress):
        self._note = lambda: note(shared, name, "epoch")
        self._progress = progress

    def on_evaluation(self, done, measures):
        self._note()
        self._progress(0.5, f"validation loss {measures['validation_loss']:.3f}")
        time.sleep(1.0)


def work(folder, progress, name, config, shared):
    train(resolve(None, None, [config]), folder / name, _Noting(shared, name, progress))
    (folder / name / "done").write_text("")
