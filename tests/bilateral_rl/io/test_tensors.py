"""Tensors as files: what comes back, and a full disk. What is refused: test_malicious_runs.py."""

import resource
import signal

import pytest
import torch

from bilateral_rl.io import tensors as tensor_files
from bilateral_rl.io.tensors import content_hash


def test_tensors_of_every_kind_come_back(tmp_path, same_bits):
    tensors = {str(dtype): torch.arange(6).reshape(2, 3).to(dtype) for dtype in tensor_files.DTYPES}
    tensors |= {"no dimension": torch.tensor(0.5), "nothing": torch.empty(0, 3), "a view": torch.arange(9.0)[::2]}
    tensor_files.save(tensors, tmp_path / "file")
    assert same_bits(tensor_files.load(tmp_path / "file", 10_000, tmp_path), tensors)


def test_a_full_disk_is_an_error_of_the_system(tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match="too large"):
            tensor_files.save({"a": torch.zeros(1000)}, tmp_path / "file")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, before)


def test_a_hash_is_of_names_types_shapes_and_values_in_any_order():
    tensors = {"a": torch.arange(6.0).reshape(2, 3), "b": torch.tensor(0.5)}
    value = content_hash(tensors)
    assert len(value) == 16
    assert content_hash({name: tensors[name] for name in ("b", "a")}) == value
    others = [
        tensors | {"b": torch.tensor(0.25)},
        tensors | {"a": torch.arange(6.0).reshape(3, 2)},
        tensors | {"a": torch.arange(6).reshape(2, 3)},
        {"a": tensors["a"]},
        {"a": tensors["a"], "c": tensors["b"]},
    ]
    assert value not in {content_hash(other) for other in others}
