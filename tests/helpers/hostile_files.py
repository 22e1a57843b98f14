"""What somebody may have put in the place of a run's files: each function writes one trap to a path."""

import io
import json
import os
import pickle
import struct
import zipfile
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file, save_file

TEN_GB = 10 * 2**30


class Canary:
    """Leaves a file where it is unpickled."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return Path.touch, (Path(self.path),)


def pickled(canary):
    return pickle.dumps(Canary(canary))


def torch_saved(canary):
    buffer = io.BytesIO()
    torch.save({"weights": Canary(canary)}, buffer)
    return buffer.getvalue()


def numpy_saved(canary):
    buffer = io.BytesIO()
    np.savez(buffer, weights=np.array([Canary(canary)], dtype=object))
    return buffer.getvalue()


def sb3_saved(canary):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("data", json.dumps({"policy_class": {":serialized:": pickle.dumps(Canary(canary)).hex()}}))
        archive.writestr("policy.pth", torch_saved(canary))
    return buffer.getvalue()


PICKLES = {"pickle": pickled, "torch": torch_saved, "numpy": numpy_saved, "sb3": sb3_saved}


def with_header(header, data=b""):
    """A safetensors file of this header, which may be anything."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


def tensor(dtype, shape, size):
    return {"dtype": dtype, "shape": shape, "data_offsets": [0, size]}


HEADERS = {
    "a header of 10 GB": struct.pack("<Q", TEN_GB) + b"{}",
    "a header of all that there is": b"\xff" * 8 + b"{}",
    "a tensor of 10 GB": with_header({"log_std": tensor("F32", [TEN_GB // 4], TEN_GB)}),
    "a tensor of 2^62 rows of nothing": with_header({"log_std": tensor("F32", [2**62, 0], 0)}),
    "a tensor of 2^63 rows of nothing": with_header({"log_std": tensor("F32", [2**63, 0], 0)}),
    "a tensor of 5,000 dimensions": with_header({"log_std": tensor("F32", [1] * 5_000, 4)}, b"1234"),
    "100,000 tensors": with_header({f"{i}": tensor("U8", [0], 0) for i in range(100_000)}),
    "nested lists": with_header(b'{"a":' + b"[" * 100_000),
    "numbers of a kind that nobody knows": with_header({"log_std": tensor("F8_E8M0", [2], 2)}, b"xx"),
    "complex numbers": with_header({"log_std": tensor("C64", [1], 8)}, b"12345678"),
    "a name that steers the terminal": with_header({"\x1b[31m[red]log_std": tensor("F32", [1], 4)}, b"1234"),
    "nothing": with_header({}),
}


def changed(path, change):
    """The tensors of the file with ``change`` made to them, as bytes."""
    tensors = {name: t.clone() for name, t in load_file(path).items()}
    change(tensors)
    other = path.with_name("changed")
    save_file(tensors, other)
    content = other.read_bytes()
    other.unlink()
    return content


def _set_one(value):
    def change(tensors):
        tensors[_weights(tensors)].view(-1)[0] = value

    return change


def _replace_one(make):
    def change(tensors):
        tensors[_weights(tensors)] = make(tensors[_weights(tensors)]).contiguous()

    return change


def _weights(tensors):
    """The name of the largest tensor of a network's, which every command needs."""
    of_network = [name for name in tensors if "weight" in name and "critic" not in name and "best" not in name]
    return max(of_network, key=lambda name: tensors[name].numel() * (tensors[name].dtype == torch.float32))


CHANGES = {
    "nan": _set_one(float("nan")),
    "inf": _set_one(float("inf")),
    "float64": _replace_one(torch.Tensor.double),
    "float16": _replace_one(torch.Tensor.half),
    "integers": _replace_one(torch.Tensor.int),
    "complex": _replace_one(lambda t: t.to(torch.complex64)),
    "one more dimension": _replace_one(lambda t: t[None]),
    "a tensor less": lambda tensors: tensors.pop(_weights(tensors)),
    "a tensor more": lambda tensors: tensors.update({f"{_weights(tensors)}/../../x": torch.zeros(1)}),
}

YAMLS = {
    "nothing": b"",
    "no words": b"\x00\xff\xfe",
    "a tag that calls": b"!!python/object/apply:os.system ['touch {canary}']",
    "a tag in a value": b"seed: !!python/object/new:os.system ['touch {canary}']",
    "a tag that is wrong": b"seed: !!bool perhaps",
    "an alias bomb": b"a0: &a0 [x, x]\n"
    + b"".join(b"a%d: &a%d [%s]\n" % (i, i, b"*a%d, " % (i - 1) * 9) for i in range(1, 40)),
    "itself": b"network: &n {units: *n}",
    "deep lists": b"- " * 400_000,
    "deep brackets": b"[" * 400_000,
    "deep keys": b"? " * 400_000,
    "many parts": b"critic_arch: [" + b"1, " * 200_000 + b"1]",
    "a number of a million digits": b"seed: 0x" + b"f" * 900_000,
    "a number in base 60": b"seed: 1" + b":59" * 300_000,
    "a long number": b"seed: " + b"9" * 1_500,
    "no date": b"seed: 2001-99-99",
    "two of them": b"seed: 1\n---\nseed: 2",
    "a list": b"[1, 2]",
    "names that are none": b"{1: 2, null: 3, 2001-01-01: 4}",
    "a name that steers the terminal": b'"\\e[31m[red]": 1',
    "a task elsewhere": b"task: ../../../etc",
    "a list of algorithms": b"algo: [ppo]",
    "a large network": b"network: {units: 1000000000}",
    "a wide network": b"network: {units: 10000, layers: 2}",
    "a deep network": b"network: {layers: 10000}",
    "large critics": b"network: {critic_arch: [10000, 10000, 10000]}",
    "many critics": b"network: {critic_arch: [" + b"1, " * 5_000 + b"1]}",
    "a long trial": b"trial: {trial_length: 1000000000}",
    "a long delay": b"trial: {feedback_delay: 1000000000}",
    "a large arm": b"trial: {arm: {link_length: [1.0e+300, 1.0e+300]}}",
    "a short step": b"trial: {arm: {timestep: 5.0e-324}}",
    "many arms": b"n_envs: 1000000000",
    "many seeds": b"{algo: bptt, seeds: 1000000000}",
    "a large batch": b"{algo: bptt, seeds: 1000, bptt: {batch_size: 1000000, trials: 1000000}}",
    "a long rollout": b"ppo: {n_steps: 1000000000}",
    "a large replay buffer": b"{algo: sac, sac: {buffer_size: 1000000000}}",
    "many threads": b"threads: 1000000000",
    "nan": b"trial: {threshold: .nan}",
    "a negative size": b"network: {critic_arch: [-1]}",
}

JSONS = {
    "no words": b"\x00\xff\xfe",
    "deep lists": b"[" * 200_000,
    "a list": b"[]",
    "a number": b"1",
    "a long number": b'{"timesteps": ' + b"9" * 4_000 + b"}",
    "a longer number": b'{"timesteps": ' + b"9" * 9_000 + b"}",
    "a negative number": b'{"timesteps": -1}',
    "true": b'{"timesteps": true}',
    "infinity": b'{"timesteps": Infinity}',
    "no name": b'{"weights": ["final"]}',
}


def as_directory(path, outside):
    path.mkdir()


def as_pipe(path, outside):
    os.mkfifo(path)


def as_device(path, outside):
    path.symlink_to("/dev/zero")


def as_endless_file(path, outside):
    path.symlink_to("/proc/self/mem")


def as_sparse_file(path, outside):
    with path.open("wb") as file:
        file.truncate(TEN_GB)


def as_link_out(path, outside):
    path.symlink_to(outside)


def as_link_to_itself(path, outside):
    path.symlink_to(path)


def as_dangling_link(path, outside):
    path.symlink_to(outside.with_name("nothing"))


PLACES = {
    "a directory": as_directory,
    "a pipe": as_pipe,
    "a device": as_device,
    "an endless file": as_endless_file,
    "10 GB": as_sparse_file,
    "a link out": as_link_out,
    "a link to itself": as_link_to_itself,
    "a link to nothing": as_dangling_link,
}
