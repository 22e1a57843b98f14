"""Whatever reads files of somebody else's, with inputs for it: random ones, sound ones that were damaged, and traps."""

import contextlib
import dataclasses
import hashlib
import json
import signal
import stat
import struct
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import hostile_files as hostile
import torch
import yaml
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from rl_runs import small_rl

from bilateral_rl.analysis.metrics import metrics_of
from bilateral_rl.analysis.results import COLUMNS, read_results
from bilateral_rl.bptt.history import read_state
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import CONFIGS
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import build_network, load_policies
from bilateral_rl.study.folder import claimed_folder
from bilateral_rl.study.outcome import learning_history
from bilateral_rl.training import checkpoint
from bilateral_rl.training.build import build_algorithm
from bilateral_rl.training.run import train

SECONDS = 30
"""That no input may take: a pipe would be waited for forever."""
READ, REFUSED = "read", "refused"
_STUDY = {"algo": "bptt", "profile": "paper", "seeds": 3, "quick": True, "overrides": {"bptt": {"trials": 64}}}


class TooLate(BaseException):
    """An input that takes too long; nothing catches it."""


@dataclass(frozen=True)
class Loader:
    """What reads a file."""

    path: Path
    """The file, sound as it is."""
    load: Callable[[], object]
    inputs: st.SearchStrategy[bytes]
    """Contents for it."""
    traps: Callable[[bytes, Path], dict[str, bytes]]
    """Contents that it must refuse, made of a sound one and of the file that appears if they are executed."""
    others: tuple[type[Exception], ...] = ()
    """What it may raise beside UserError, as its documentation says."""

    def outcome(self, trap: hostile.Trap) -> str:
        """Whether ``trap`` is read or refused. Anything else that happens is a fault, and raised."""
        hostile.put(self.path, trap)
        before = listing(self.path.parents[1])
        outcome = READ
        with in_time(), warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                self.load()
            except UserError as error:
                if not str(error).isprintable() or len(str(error)) > 5_000:
                    raise ValueError(f"not one line for people: {error!r}") from error
                outcome = REFUSED
            except self.others:
                outcome = REFUSED
        assert listing(self.path.parents[1]) == before, "a file was changed"
        return outcome


def fuzz(loader: Loader, n: int, number: int) -> Counter[str]:
    """How many of ``n`` inputs, of the random stream ``number``, ended how."""
    outcomes: Counter[str] = Counter()
    sound = loader.path.read_bytes()

    @seed(number)
    @settings(
        max_examples=n,
        database=None,
        deadline=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(loader.inputs)
    def run(content: bytes) -> None:
        outcomes[loader.outcome(content)] += 1

    try:
        assert loader.outcome(sound) == READ
        run()
    finally:
        hostile.put(loader.path, sound)
    return outcomes


def listing(folder: Path) -> dict[str, tuple[int, ...]]:
    """Everything below ``folder``: its kind, and the size, time and contents of files."""
    found = {}
    for path in folder.rglob("*"):
        status = path.lstat()
        found[str(path)] = (status.st_mode,)
        if not stat.S_ISDIR(status.st_mode):
            small = stat.S_ISREG(status.st_mode) and status.st_size < 2**22
            content = hashlib.sha256(path.read_bytes()).digest() if small else b""
            found[str(path)] += (status.st_size, status.st_mtime_ns, content)
    return found


@contextlib.contextmanager
def in_time():
    def too_late(*_: object) -> None:
        raise TooLate

    before = signal.signal(signal.SIGALRM, too_late)
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def peak_memory(reset: bool = False) -> int:
    """Of this process (bytes), since it was last reset."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5")
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return 1024 * int(line.split()[1])


# Inputs


def damaged(sound: bytes, words: list[bytes]) -> st.SearchStrategy[bytes]:
    """``sound`` after a few changes: bits flipped, parts cut out, repeated, moved, or replaced by one of ``words``."""
    place = st.integers(0, len(sound))
    change = st.one_of(
        st.tuples(st.just("flip"), place, st.integers(0, 7)),
        st.tuples(st.just("cut"), place, place),
        st.tuples(st.just("end"), place, place),
        st.tuples(st.just("repeat"), place, place),
        st.tuples(st.just("put"), place, st.one_of(st.binary(max_size=8), st.sampled_from(words))),
        st.tuples(st.just("word"), place, st.sampled_from(words)),
    )
    return st.lists(change, min_size=1, max_size=4).map(lambda changes: _changed(sound, changes))


def _changed(content: bytes, changes: list[tuple[str, int, Any]]) -> bytes:
    for kind, place, what in changes:
        i = min(place, len(content))
        if kind == "flip" and i < len(content):
            content = content[:i] + bytes([content[i] ^ (1 << what)]) + content[i + 1 :]
        elif kind == "cut":
            content = content[: min(i, what)] + content[max(i, what) :]
        elif kind == "end":
            content = content[:i]
        elif kind == "repeat":
            content = content[:i] + content[min(i, what) : max(i, what)] + content[i:]
        elif kind == "put":
            content = content[:i] + what + content[i:]
        elif kind == "word":  # in the place of the word that begins there
            end = next((j for j in range(i, len(content)) if content[j : j + 1] in b" ,\n:\"'[]{}"), len(content))
            content = content[:i] + what + content[end:]
    return content


_TEXTS = [
    b"-1", b"0", b"1e999", b".nan", b"NaN", b"Infinity", b"9" * 400, b"0x" + b"f" * 300, b"1:59:59", b"null", b"true",
    b"2001-99-99", b"&a", b"*a", b"<<", b"!!python/object/apply:os.abort []", b"!!bool", b"{", b"[", b"- ", b"? ", b'"',
    b"\0", b"\x1b[31m", b"\xff\xfe", b"../../x", b"ppo", b"bptt", b"sac", b"hold_position", b"\n", b"1e-3", b"10000",
]  # fmt: skip
_NAMES = sorted(
    {field.name for config in CONFIGS.values() for field in dataclasses.fields(config)}
    | {"units", "layers", "critic_arch", "trial_length", "threshold", "arm", "link_length", "learning_rate", "weights"}
)


def documents() -> st.SearchStrategy[bytes]:
    """YAML and JSON of nested settings, with names that there are and values that there may be."""
    scalars = st.one_of(
        st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), st.sampled_from(["cc_s", "bptt"])
    )
    names = st.one_of(st.sampled_from(_NAMES), st.text(max_size=8))
    values = st.recursive(
        scalars, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(names, inner, max_size=5), max_leaves=25
    )
    whole = st.dictionaries(names, values, max_size=6)
    return st.one_of(whole, values).flatmap(
        lambda value: st.sampled_from([yaml.safe_dump(value).encode(), json.dumps(value).encode()])
    )


def tensor_files() -> st.SearchStrategy[bytes]:
    """Safetensors files whose headers claim anything."""
    numbers = st.one_of(st.integers(-2, 40), st.sampled_from([2**31, 2**32, 2**62, 2**63, 2**64, 10 * 2**30]))
    tensor = st.fixed_dictionaries(
        {
            "dtype": st.sampled_from(["F32", "F64", "F16", "BF16", "I64", "U8", "BOOL", "C64", "F8_E4M3", "F4", "X"]),
            "shape": st.lists(numbers, max_size=4),
            "data_offsets": st.lists(numbers, min_size=2, max_size=2),
        }
    )
    names = st.one_of(st.sampled_from(["seeds", "output.weight", "log_std", "__metadata__"]), st.text(max_size=6))
    return st.builds(
        _tensor_file, st.dictionaries(names, tensor, max_size=4), st.binary(max_size=64), st.integers(-2, 2)
    )


def _tensor_file(header: dict[str, Any], data: bytes, more: int) -> bytes:
    text = json.dumps(header).encode()
    return struct.pack("<Q", max(len(text) + more, 0)) + text + data


def _for_text(sound: bytes) -> st.SearchStrategy[bytes]:
    return st.one_of(damaged(sound, _TEXTS), documents(), st.binary(max_size=200))


def _for_tensors(sound: bytes) -> st.SearchStrategy[bytes]:
    length = 8 + int.from_bytes(sound[:8], "little")
    words = [b"I64", b"F64", b"C64", b"[0]", b"[9999999999]", b"-1", b"\0" * 8, b"\xff" * 8, b"\x7f\x80", b'"', b"}"]
    in_header = damaged(sound[:length], words).map(lambda header: header + sound[length:])
    return st.one_of(in_header, damaged(sound, words), tensor_files(), st.binary(max_size=200))


def _for_tables(sound: bytes) -> st.SearchStrategy[bytes]:
    rows = st.lists(st.sampled_from(sound.splitlines(keepends=True)[1:]), max_size=20)
    shuffled = rows.map(lambda some: sound.splitlines(keepends=True)[0] + b"".join(some))
    return st.one_of(damaged(sound, [*_TEXTS, b",", b",,", b"intact", b"callosum"]), shuffled, st.binary(max_size=200))


# Loaders


def make_loaders(folder: Path) -> dict[str, Loader]:
    """Every one by name, on files of small runs and of a study below ``folder``."""
    tiny = {"network": {"units": 4, "critic_arch": [4]}, "timesteps": 400}
    small_bptt = {"seeds": 2, "epochs": 3, "bptt": {"trials": 32, "batch_size": 16, "validation_trials": 8}}
    configs = {
        "ppo": small_rl("ppo", **tiny),
        "sac": small_rl("sac", **tiny, sac={"buffer_size": 40}),
        "bptt": resolve("bptt", None, [small_bptt, {"network": {"units": 4}, "trial": {"trial_length": 5}}]),
    }
    loaders = {}
    for algo, config in configs.items():
        run = train(config, folder).folder
        if algo != "bptt":  # without what a training adds to it
            run.save_resume({name: t.clone() for name, t in checkpoint.state_tensors(_algorithm(config)).items()})
        loaders |= {
            f"config.yaml ({algo})": _loader(run, "config.yaml", "yaml", run.config),
            f"weights ({algo})": _loader(run, "weights/final.safetensors", "tensors", partial(load_policies, run)),
            f"resume ({algo})": _loader(run, "resume.safetensors", "tensors", _restore(run), ValueError),
            f"status.json ({algo})": _loader(run, "status.json", "json", run.status),
        }
        table = "epochs.csv" if algo == "bptt" else "evaluations.csv"
        loaders[f"{table} ({algo})"] = _loader(run, table, "table", partial(learning_history, {"cc_s": [run]}))
    beside = RunFolder(folder / "beside")
    (beside.path / "results").mkdir(parents=True)
    beside.write_text("study.yaml", yaml.safe_dump(_STUDY))
    beside.write_text("results/cc_s.csv", _results())
    results = partial(read_results, beside.path / "results/cc_s.csv")
    return loaders | {
        "study.yaml": _loader(beside, "study.yaml", "yaml", partial(_claim, beside.path)),
        "results": _loader(beside, "results/cc_s.csv", "table", results),
    }


_INPUTS = {"yaml": _for_text, "json": _for_text, "table": _for_tables, "tensors": _for_tensors}
_TRAPS: dict[str, Callable[[bytes, Path], dict[str, bytes]]] = {
    "yaml": lambda sound, canary: hostile.yaml_traps(canary),
    "json": lambda *_: hostile.JSONS,
    "table": lambda *_: hostile.TABLES,
    "tensors": lambda sound, _: hostile.tensor_traps(sound),
}


def _loader(run: RunFolder, file: str, kind: str, load: Callable[[], object], *others: type[Exception]) -> Loader:
    path = run.path / file
    return Loader(path, load, _INPUTS[kind](path.read_bytes()), _TRAPS[kind], others)


def _restore(run: RunFolder) -> Callable[[], object]:
    config = run.config()
    if config.algo == "bptt":
        layout = Layout(build_network(config))
        return lambda: read_state(run.load_resume(), config, layout)  # type: ignore[arg-type]
    return lambda: checkpoint.restore(_algorithm(config), run.load_resume())


def _algorithm(config: Any) -> Any:
    algorithm = build_algorithm(config)
    torch.set_num_threads(1)
    algorithm._setup_learn(1)
    return algorithm


def _claim(folder: Path) -> None:
    with claimed_folder(folder, _STUDY):
        pass


def _results() -> str:
    names = [metric.name for metric in metrics_of("random_reach", [0.05])]
    rows = [
        f"cc_s,random_reach,bptt,{one},{lesion},{treatment},{name},{0.5 + one}"
        for one in range(2)
        for lesion in ("intact", "callosum")
        for treatment in ("trained,none,none,0,,none,,none,none", "fresh,output,output,1,0.001,weights,0.001,fresh,new")
        for name in names
    ]
    return "\n".join([",".join(COLUMNS), *rows, ""])
