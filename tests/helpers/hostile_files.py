"""What somebody may have put in the place of a run's files: bytes, or functions that make a trap of a path."""

import io
import json
import os
import pickle
import shutil
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import torch
from safetensors.torch import load, save

from bilateral_rl.analysis.results import COLUMNS

TEN_GB = 10 * 2**30

Trap = bytes | Callable[[Path], object]


class Canary:
    """Leaves a file where it is unpickled."""

    def __init__(self, path):
        self.path = str(path)

    def __reduce__(self):
        return Path.touch, (Path(self.path),)


def sb3_saved(canary):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("data", json.dumps({"policy_class": {":serialized:": pickle.dumps(Canary(canary)).hex()}}))
        archive.writestr("policy.pth", pickles(canary)["a pickle of torch's"])
    return buffer.getvalue()


def pickles(canary):
    buffer = io.BytesIO()
    torch.save({"weights": Canary(canary)}, buffer)
    return {"a pickle": pickle.dumps(Canary(canary)), "a pickle of torch's": buffer.getvalue()}


def places(outside):
    """Things that are no file of the folder; ``outside`` is somebody's own file."""
    return {
        "a folder": Path.mkdir,
        "a pipe": os.mkfifo,
        "a device": lambda path: path.symlink_to("/dev/zero"),
        "an endless file": lambda path: path.symlink_to("/proc/self/mem"),
        "10 GB": lambda path: (path.touch(), os.truncate(path, TEN_GB)),
        "a link out": lambda path: path.symlink_to(outside),
        "a link to itself": lambda path: path.symlink_to(path),
    }


def put(path, trap):
    """Make ``trap`` of whatever is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    if callable(trap):
        trap(path)
    else:
        path.write_bytes(trap)


def yaml_traps(canary):
    return {
        "nothing": b"",
        "no words": b"\x00\xff\xfe",
        "a tag that calls": b"!!python/object/apply:os.system ['touch %s']" % os.fsencode(canary),
        "a tag in a value": b"seed: !!python/object/new:os.system ['touch %s']" % os.fsencode(canary),
        "a tag that is wrong": b"seed: !!bool perhaps",
        "an alias bomb": b"a0: &a0 [x, x]\n"
        + b"".join(b"a%d: &a%d [%s]\n" % (i, i, b"*a%d, " % (i - 1) * 9) for i in range(1, 40)),
        "itself": b"network: &n {units: *n}",
        "deep lists": b"- " * 30_000,
        "deep brackets": b"[" * 60_000,
        "deep keys": b"? " * 30_000,
        "many parts": b"critic_arch: [" + b"1, " * 20_000 + b"1]",
        "a megabyte": b"seed: 1" + b":59" * 300_000,
        "a number too long to print": b"seed: 0x" + b"f" * 50_000,
        "a long number": b"seed: " + b"9" * 1_500,
        "no date": b"seed: 2001-99-99",
        "two of them": b"seed: 1\n---\nseed: 2",
        "a list": b"[1, 2]",
        "names that are none": b"{1: 2, null: 3, 2001-01-01: 4}",
        "a name that steers the terminal": b'"\\e[31m[red]": 1',
        "a task elsewhere": b"task: ../../../etc",
        "a list of algorithms": b"algo: [ppo]",
        "many arms": b"n_envs: 1000000000",
        "no finite number": b"trial: {threshold: .nan}",
    }


JSONS = {
    "no words": b"\x00\xff\xfe",
    "deep lists": b"[" * 200_000,
    "a list": b"[]",
    "a long number": b'{"timesteps": ' + b"9" * 4_000 + b"}",
    "a longer number": b'{"timesteps": ' + b"9" * 9_000 + b"}",
    "a negative number": b'{"timesteps": -1}',
    "true": b'{"timesteps": true}',
    "infinity": b'{"timesteps": Infinity}',
    "no name": b'{"weights": ["final"]}',
}


def _table(*rows):
    return "\n".join([",".join(COLUMNS), *rows]).encode()


_CURVE = b"seed,epoch,validation_loss,goal_completion_percent,time_in_goal_steps\n"
TABLES = {
    "no words": b"\xff\xfe\x00",
    "nothing": b"",
    "columns without end": b"a," * 10_000_000,
    "a longer row": _table("1," * 100_000),
    "a quote without end": _table('"' + "x" * 1_000_000),
    "an unknown lesion": _table("cc_s,random_reach,ppo,0,\x1b[31m[red],trained,none,none,0,,none,,none,none,effort,1"),
    "an unknown model": _table(
        "$\\input{/etc/passwd}$,random_reach,ppo,0,intact,trained,none,none,0,,none,,none,none,effort,1"
    ),
    "a number too large": _table("cc_s,random_reach,ppo,0,intact,trained,none,none,0,,none,,none,none,effort,1e300"),
    "a seed too large": _table("cc_s,random_reach,ppo,1e300,intact,trained,none,none,0,,none,,none,none,effort,1"),
    "many seeds": _table(
        *(f"cc_s,random_reach,ppo,{i},intact,trained,none,none,0,,none,,none,none,effort,1" for i in range(100_000))
    ),
    "a value twice": _table(*2 * ["cc_s,random_reach,ppo,0,intact,trained,none,none,0,,none,,none,none,effort,1"]),
    "another seed": _CURVE + b"9,1,1.5,1.5,1.5",
    "a curve without end": _CURVE + b"".join(b"0,%d,1.5,1.5,1.5\n" % i for i in range(200_000)),
}


def with_header(header, data=b""):
    """A safetensors file of this header, which may be anything."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


def _one(dtype, shape, size, data=b"", name="log_std"):
    return with_header({name: {"dtype": dtype, "shape": shape, "data_offsets": [0, size]}}, data)


HEADERS = {
    "a header of 10 GB": struct.pack("<Q", TEN_GB) + b"{}",
    "a header of all that there is": b"\xff" * 8 + b"{}",
    "a tensor of 10 GB": _one("F32", [TEN_GB // 4], TEN_GB),
    "a tensor of 2^62 rows of nothing": _one("F32", [2**62, 0], 0),
    "a tensor of 2^63 rows of nothing": _one("F32", [2**63, 0], 0),
    "a tensor of 5,000 dimensions": _one("F32", [1] * 5_000, 4, b"1234"),
    "nested lists": with_header(b'{"a":' + b"[" * 100_000),
    "numbers of a kind that nobody knows": _one("F8_E8M0", [2], 2, b"xx"),
    "complex numbers": _one("C64", [1], 8, b"12345678"),
    "a name that steers the terminal": _one("F32", [1], 4, b"1234", name="\x1b[31m[red]log_std"),
    "nothing": with_header({}),
}


def changed(sound, change):
    """The file ``sound`` with ``change`` made to its largest tensor of the network: to its name or to its value."""
    tensors = load(sound)
    of_network = [name for name in tensors if "weight" in name and "critic" not in name and "best" not in name]
    name = max(of_network, key=lambda name: tensors[name].numel() * (tensors[name].dtype == torch.float32))
    change(tensors, name)
    return save({name: tensor.contiguous() for name, tensor in tensors.items()})


CHANGES = {
    "nan": lambda tensors, name: tensors[name].view(-1)[:1].fill_(float("nan")),
    "inf": lambda tensors, name: tensors[name].view(-1)[:1].fill_(float("inf")),
    "float64": lambda tensors, name: tensors.update({name: tensors[name].double()}),
    "float16": lambda tensors, name: tensors.update({name: tensors[name].half()}),
    "integers": lambda tensors, name: tensors.update({name: tensors[name].int()}),
    "complex": lambda tensors, name: tensors.update({name: tensors[name].to(torch.complex64)}),
    "one more dimension": lambda tensors, name: tensors.update({name: tensors[name][None]}),
    "a tensor less": lambda tensors, name: tensors.pop(name),
    "a tensor more": lambda tensors, name: tensors.update({f"{name}/../../x": torch.zeros(1)}),
}


def tensor_traps(sound):
    """Files of other headers, files of other tensors, and ``sound`` cut off anywhere."""
    ends = [*range(17), *range(17, len(sound), len(sound) // 25), len(sound) - 1]
    cut = {f"cut at {end}": sound[:end] for end in ends}
    return HEADERS | {kind: changed(sound, change) for kind, change in CHANGES.items()} | cut
