"""Whatever reads files of somebody else's, with inputs for it: random ones, and sound ones that were damaged."""

import contextlib
import dataclasses
import json
import signal
import struct
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import torch
import yaml
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from bilateral_rl.analysis.metrics import metrics_of
from bilateral_rl.analysis.results import COLUMNS, read_results
from bilateral_rl.bptt.layout import Layout
from bilateral_rl.bptt.state import TrainingState
from bilateral_rl.bptt.trainer import history_columns
from bilateral_rl.config.resolve import resolve
from bilateral_rl.config.schema import CONFIGS, BPTTConfig, TrainConfig
from bilateral_rl.io.errors import UserError
from bilateral_rl.runs.folder import RunFolder
from bilateral_rl.runs.policies import build_network, build_policy, load_policies, stack_states
from bilateral_rl.study.folder import claimed_folder
from bilateral_rl.study.outcome import learning_history
from bilateral_rl.training import checkpoint as rl_state
from bilateral_rl.training.build import build_algorithm

SECONDS = 30
"""That no input may take."""
READ, REFUSED = "read", "refused"
_SMALL = {"n_envs": 2, "network": {"units": 4, "critic_arch": [4]}}
_STUDY = {"algo": "bptt", "profile": "paper", "seeds": 3, "quick": True, "overrides": {"bptt": {"trials": 64}}}


class TooLate(BaseException):
    """An input that takes too long; nothing catches it."""


@dataclass(frozen=True)
class Loader:
    """What reads a file."""

    name: str
    path: Path
    """The file, sound as it is."""
    load: Callable[[], object]
    inputs: st.SearchStrategy[bytes]
    """Contents for it."""
    others: tuple[type[Exception], ...] = ()
    """What it may raise beside UserError, as its documentation says."""

    def outcome(self, content: bytes) -> str:
        """Whether ``content`` is read or refused. Anything else that happens is a fault, and raised."""
        self.path.write_bytes(content)
        before = _listing(self.path.parents[1])
        outcome = READ
        with _in_time(), warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                self.load()
            except UserError as error:
                if not str(error).isprintable():
                    raise ValueError(f"not one line for people: {error!r}") from error
                outcome = REFUSED
            except self.others:
                outcome = REFUSED
        assert _listing(self.path.parents[1]) == before, "a file was changed"
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
        loader.path.write_bytes(sound)
    return outcomes


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


def make_loaders(folder: Path) -> list[Loader]:
    """Every one, on files below ``folder``."""
    rl, bptt = _run(folder, resolve("ppo", None, [_SMALL])), _run(folder, _bptt_config())
    replayed = _run(folder, resolve("sac", None, [_SMALL, {"sac": {"buffer_size": 40}}]))
    loaders = [
        _loader("config.yaml", rl, "config.yaml", _for_text, lambda: rl.config()),
        _loader("config.yaml (bptt)", bptt, "config.yaml", _for_text, lambda: bptt.config()),
        _loader("config.yaml (sac)", replayed, "config.yaml", _for_text, lambda: replayed.config()),
        _loader("status.json", rl, "status.json", _for_text, rl.status),
    ]
    for name, run in (("", rl), (" (bptt)", bptt), (" (sac)", replayed)):
        loaders.append(_loader(f"weights{name}", run, "weights/final.safetensors", _for_tensors, _load(run)))
    for name, run in (("", rl), (" (bptt)", bptt), (" (sac)", replayed)):
        loaders.append(_loader(f"resume{name}", run, "resume.safetensors", _for_tensors, _restore(run), (ValueError,)))
    place = RunFolder(folder / "beside")
    (place.path / "results").mkdir(parents=True)
    place.write_json("settings.json", {"run": "x", "weights": "final", "trials": 4})
    place.write_text("study.yaml", yaml.safe_dump(_STUDY))
    place.write_text("results/cc_s.csv", _results().to_csv(index=False))
    results = place.path / "results/cc_s.csv"
    return [
        *loaders,
        _loader("settings.json", place, "settings.json", _for_text, lambda: place.read_json("settings.json")),
        _loader("study.yaml", place, "study.yaml", _for_text, lambda: claimed_folder(place.path, _STUDY).__enter__()),
        _loader("results", place, "results/cc_s.csv", _for_tables, lambda: read_results(results)),
        _loader("epochs.csv", bptt, "epochs.csv", _for_tables, lambda: learning_history({"cc_s": [bptt]})),
        _loader("evaluations.csv", rl, "evaluations.csv", _for_tables, lambda: learning_history({"cc_s": [rl]})),
    ]


def _loader(
    name: str,
    run: RunFolder,
    file: str,
    inputs: Callable[[bytes], st.SearchStrategy[bytes]],
    load: Callable[[], object],
    others: tuple[type[Exception], ...] = (),
) -> Loader:
    path = run.path / file
    return Loader(name, path, load, inputs(path.read_bytes()), others)


def _bptt_config() -> BPTTConfig:
    config = resolve("bptt", None, [{"seeds": 2, "network": {"units": 4}, "trial": {"trial_length": 5}}])
    assert isinstance(config, BPTTConfig)
    return config


def _run(folder: Path, config: TrainConfig) -> RunFolder:
    """A run as if it had been trained, with all that loaders read."""
    run = RunFolder.create(folder, config)
    if isinstance(config, BPTTConfig):
        networks = {one: build_network(config).state_dict() for one in config.all_seeds}
        run.save_weights("final", stack_states(networks))
        layout = Layout(build_network(config))
        columns = history_columns(config, layout)
        run.save_resume(TrainingState.start(layout.pack(list(networks.values())), len(columns)).tensors())
        rows = pd.DataFrame(1.5, range(6), columns).assign(seed=[0, 0, 0, 1, 1, 1], epoch=[1, 2, 3] * 2)
        run.write_text("epochs.csv", rows.to_csv(index=False))
        run.write_json("status.json", {"state": "interrupted", "epochs": 3, "updates": 3, "weights": "final"})
        return run
    run.save_weights("final", build_policy(config).state_dict())
    run.save_resume(_rl_state(config))
    measures = ["goal_completion_percent", "time_in_goal_steps", "final_error_cm", "return_scalar"]
    run.write_text(
        "evaluations.csv", pd.DataFrame(1.5, range(3), measures).assign(timesteps=range(3)).to_csv(index=False)
    )
    run.write_json("status.json", {"state": "finished", "timesteps": 100, "updates": 5, "weights": "final"})
    return run


def _algorithm(config: TrainConfig) -> Any:
    algorithm = build_algorithm(config)  # type: ignore[arg-type]
    torch.set_num_threads(1)
    algorithm._setup_learn(1)
    return algorithm


def _rl_state(config: TrainConfig) -> dict[str, torch.Tensor]:
    return {name: tensor.clone() for name, tensor in rl_state.state_tensors(_algorithm(config)).items()}


def _load(run: RunFolder) -> Callable[[], object]:
    return lambda: load_policies(run)


def _restore(run: RunFolder) -> Callable[[], object]:
    config = run.config()
    if isinstance(config, BPTTConfig):
        layout = Layout(build_network(config))
        sizes = (config.seeds, layout.width, len(history_columns(config, layout)))
        return lambda: TrainingState.from_tensors(run.load_resume(), *sizes)
    return lambda: rl_state.restore(_algorithm(config), run.load_resume())


def _results() -> pd.DataFrame:
    names = [metric.name for metric in metrics_of("random_reach", [0.05])]
    rows = [
        ("cc_s", "random_reach", "bptt", one, lesion, retrained, name, 0.5 + one)
        for one in range(2)
        for lesion in ("intact", "callosum")
        for retrained in (False, True)
        for name in names
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _listing(folder: Path) -> list[tuple[str, int, int]]:
    return sorted((str(path), path.lstat().st_size, path.lstat().st_mtime_ns) for path in folder.rglob("*"))


@contextlib.contextmanager
def _in_time() -> Iterator[None]:
    def too_late(*_: object) -> None:
        raise TooLate

    before = signal.signal(signal.SIGALRM, too_late)
    signal.alarm(SECONDS)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
