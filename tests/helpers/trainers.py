"""Supervised trainers at their end, and what their state holds of a seed."""

OF_SEEDS = ("weights", "first", "second", "best_weights", "best_loss", "waited", "seed_state", "failed_batch", "epochs")


def finish(trainer):
    while not trainer.finished:
        assert trainer.run_epoch()
    return trainer.state


def of_seed(state, index):
    """Everything that the state holds of one seed, the history as far as the seed came."""
    parts = {name: getattr(state, name)[index] for name in OF_SEEDS}
    return parts | {"history": state.history[index, : int(state.epochs[index])]}
