"""How far a stacked training has come: everything that the rest of it depends on, for every seed."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from enum import IntEnum

import torch
from torch import Tensor


class SeedState(IntEnum):
    """State of one seed's training."""

    TRAINING = 0
    CONVERGED = 1
    """Stopped early, as its validation loss was no longer getting better."""
    FAILED = 2
    """Stopped, as its loss was no longer finite."""


@dataclass
class TrainingState:
    """State of the training of ``S`` seeds with rows of ``width`` parameters; all fields are tensors, ready to save."""

    weights: Tensor
    """(S, width), the present parameters."""
    first: Tensor
    """(S, width), Adam's first moments."""
    second: Tensor
    """(S, width), Adam's second moments."""
    best_weights: Tensor
    """(S, width), at the best validation loss so far."""
    best_loss: Tensor
    """(S,) float64, the best validation loss so far; infinite before the first."""
    waited: Tensor
    """(S,) int64, epochs since then."""
    seed_state: Tensor
    """(S,) int64, a ``SeedState`` each."""
    failed_batch: Tensor
    """(S,) int64, the batch, from 1, in which a failed seed failed; 0 for others."""
    history: Tensor
    """(S, epochs, columns) float64: what each epoch brought; NaN where there was none."""
    epochs: Tensor
    """(S,) int64, whole epochs of each seed."""
    updates: Tensor
    """() int64, updates of every seed that still trains."""

    @classmethod
    def start(cls, weights: Tensor, n_columns: int) -> TrainingState:
        """Return the state before the first epoch of networks with ``weights`` (S, width)."""
        n = len(weights)
        return cls(
            weights=weights.clone(),
            first=torch.zeros_like(weights),
            second=torch.zeros_like(weights),
            best_weights=weights.clone(),
            best_loss=torch.full((n,), torch.inf, dtype=torch.float64),
            waited=torch.zeros(n, dtype=torch.int64),
            seed_state=torch.zeros(n, dtype=torch.int64),
            failed_batch=torch.zeros(n, dtype=torch.int64),
            history=torch.zeros(n, 0, n_columns, dtype=torch.float64),
            epochs=torch.zeros(n, dtype=torch.int64),
            updates=torch.zeros((), dtype=torch.int64),
        )

    @property
    def epoch(self) -> int:
        """Number of epochs done by the seed that came furthest."""
        return self.history.shape[1]

    def training(self) -> list[int]:
        """Return the indices of the seeds that still train."""
        return (self.seed_state == SeedState.TRAINING).nonzero().flatten().tolist()

    def tensors(self) -> dict[str, Tensor]:
        """Return every field by name."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}

    @classmethod
    def from_tensors(cls, tensors: dict[str, Tensor], n_seeds: int, width: int, n_columns: int) -> TrainingState:
        """Return the state with the fields of :meth:`tensors`.

        Raises:
            ValueError: fields of other names, shapes or types, or numbers that such a training cannot come to.
        """
        names = [f.name for f in dataclasses.fields(cls)]
        if sorted(names) != sorted(tensors):
            raise ValueError(f"it must hold {', '.join(names)}")
        like = cls.start(torch.zeros(n_seeds, width), n_columns)
        n_epochs = tensors["history"].shape[1] if tensors["history"].ndim == 3 else 0
        for name, tensor in like.tensors().items():
            shape = (n_seeds, n_epochs, n_columns) if name == "history" else tuple(tensor.shape)
            if tuple(tensors[name].shape) != shape or tensors[name].dtype != tensor.dtype:
                raise ValueError(f"its {name} is not a {tensor.dtype} tensor of shape {shape}")
        state = cls(**{name: tensors[name].clone() for name in names})
        if not state._is_possible():
            raise ValueError("its numbers are out of range")
        return state

    def _is_possible(self) -> bool:
        """Return whether a training could have come to these numbers."""
        finite = (self.weights, self.first, self.second, self.best_weights)
        known = torch.tensor(list(SeedState))
        return bool(
            all(tensor.isfinite().all() for tensor in finite)
            and torch.isin(self.seed_state, known).all()
            and (self.epochs >= 0).all()
            and (self.epochs <= self.epoch).all()
            and (self.waited >= 0).all()
            and (self.failed_batch >= 0).all()
            and self.updates >= 0
            and not self.best_loss.isnan().any()
        )
