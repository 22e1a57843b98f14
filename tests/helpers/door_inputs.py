"""What may be given to a door: arrays of any shape, type, content and layout, tensors, and what is neither."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from hypothesis import strategies as st
from hypothesis.extra import numpy as np_st
from rich_tasks import no_forces

from bilateral_rl.envs.tasks import NEVER, HandForces, Spring, Timeline

N = 3
"""Arms of the batches that are tried."""
LENGTH = 4
"""Steps of their trials."""

_ANY_TYPE = st.one_of(
    np_st.boolean_dtypes(), np_st.integer_dtypes(), np_st.unsigned_integer_dtypes(), np_st.floating_dtypes(),
    np_st.complex_number_dtypes(), np_st.datetime64_dtypes(), np_st.byte_string_dtypes(), np_st.unicode_string_dtypes(),
)  # fmt: skip
_REALS = st.sampled_from(["f4", "f8", ">f8", "f2", "i8", "u1"]).map(np.dtype)
_SHAPES = np_st.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5)
SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(-3, 70), st.integers(), st.floats(), st.complex_numbers(),
    st.text(max_size=4), st.binary(max_size=4),
    st.sampled_from([np.int64(2), np.float32(0.5), np.bool_(True), object(), int, np.nan]),
)  # fmt: skip


def choice(*kinds: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """One of ``kinds``, each as often as the others; ``one_of`` would count those that a kind consists of."""
    return st.sampled_from(kinds).flatmap(lambda kind: kind)


@st.composite
def laid_out(draw: Any, array: st.SearchStrategy[Any]) -> Any:
    """An array in another memory layout: Fortran's order, every other row, backwards, read-only, or a broadcast row."""
    values = draw(array)
    way = draw(
        st.sampled_from(["as it is", "fortran", "strided", "backwards", "read-only", "broadcast", "list", "object"])
    )
    if way == "fortran":
        return np.asfortranarray(values)
    if way == "strided" and values.ndim:
        return np.repeat(values, 2, axis=0)[::2]
    if way == "backwards" and values.ndim:
        return values[::-1]
    if way == "broadcast" and values.ndim and len(values):
        return np.broadcast_to(values[:1], values.shape)
    if way == "list":
        return values.tolist()
    if way == "object":
        return values.astype(object)
    values.flags.writeable = way != "read-only"
    return values


def anything(shape: tuple[int, ...], low: float = 0.0, high: float = 2.0) -> st.SearchStrategy[Any]:
    """What may be given for an array of ``shape``: as often as not a sound one, or one that is so but for something."""
    wild = st.floats(width=32) | st.sampled_from([np.nan, np.inf, -np.inf, 1e300, -0.0])
    inside = st.floats(low, high, width=16)
    near = st.sampled_from(
        [shape, shape, shape, (1, *shape[1:]), shape[1:], (shape[0] + 1, *shape[1:]), (*shape, 1), ()]
    )
    sound = np_st.arrays(_REALS, shape, elements=st.integers(0, int(high)), fill=st.nothing())
    return choice(
        laid_out(sound),
        sound,
        sound,
        sound,
        laid_out(np_st.arrays(st.sampled_from(["f4", "f8"]), near, elements=inside)),
        laid_out(np_st.arrays(st.just(np.dtype("f8")), near, elements=inside | wild)),
        laid_out(np_st.arrays(_ANY_TYPE, _SHAPES)),
        st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=4), max_leaves=8),
    )


def tensors(shape: tuple[int, ...]) -> st.SearchStrategy[Any]:
    """Tensors that may be given for one of ``shape``, and what is none."""
    kinds = [
        torch.float32,
        torch.float64,
        torch.float16,
        torch.bfloat16,
        torch.int64,
        torch.uint8,
        torch.bool,
        torch.cfloat,
    ]

    @st.composite
    def tensor(draw: Any) -> Any:
        sizes = draw(
            st.sampled_from([shape, shape, shape, (1, *shape[1:]), shape[1:], (0, *shape[1:]), (*shape, 2), ()])
        )
        values = torch.rand(sizes).to(draw(st.sampled_from(kinds)))
        way = draw(
            st.sampled_from(["as it is", "expanded", "strided", "transposed", "sparse", "meta", "gradient", "nan"])
        )
        if way == "expanded" and values.ndim:
            return values[:1].expand(sizes)
        if way == "strided" and values.ndim:
            return values.repeat_interleave(2, 0)[::2]
        if way == "transposed" and values.ndim > 1:
            return values.transpose(0, 1).contiguous().transpose(0, 1)
        if way == "sparse":
            return values.to_sparse() if values.ndim else values
        if way == "meta":
            return values.to("meta")
        if way == "gradient" and values.is_floating_point():
            return values.requires_grad_()
        return values * float("nan") if way == "nan" and values.is_floating_point() else values

    return choice(tensor(), tensor(), tensor(), laid_out(np_st.arrays(_ANY_TYPE, _SHAPES)), SCALARS)


@st.composite
def trials(draw: Any, n: int, rich: bool = False) -> tuple[Any, ...]:
    """The three fields of ``n`` trials, or all five, of which some may be anything."""
    fields: list[Any] = [np.full((n, 2), 0.5), np.float32([[1.0, 1.5]]), [0.0, 1.0]]
    if rich and draw(st.integers(0, 2)):
        return (*fields, *draw(timelines_and_forces(n)))
    for i in draw(st.sampled_from([(0,), (1,), (2,), (0, 1, 2)])):
        fields[i] = draw(anything((n, 2)))
    return (*fields, Timeline(0, NEVER, (0.5, 0.5)), no_forces()) if rich else tuple(fields)


@st.composite
def trials_of_two_arms(draw: Any, n: int) -> tuple[Any, ...]:
    """The fields of ``n`` trials of two arms, of which one may be anything, or the spring."""
    fields: list[Any] = [np.full((n, 2, 2), 0.5), np.float32([[[1.0, 1.5], [0.5, 0.5]]]), np.zeros((2, 2)), None, None]
    spring: list[Any] = [np.full(n, 50.0), 1.0]
    i = draw(st.integers(0, 4))
    if i < 3:
        fields[i] = draw(anything((n, 2, 2)))
    else:
        spring[i - 3] = draw(anything((n,), 0, 99))
    whole = st.sampled_from([Spring(*spring)] * 6 + [None, tuple(spring), no_forces()])
    return (*fields, draw(whole))


@st.composite
def timelines_and_forces(draw: Any, n: int) -> tuple[Any, Any]:
    """What a trial has beyond its places; one or two things may be anything."""
    timeline: dict[str, Any] = {"go": 1, "jump": np.full(n, 2), "jump_goal": np.full((n, 2), 0.7)}
    forces = no_forces(pulse=(1.0, 2.0), pulse_window=(1, 2))._asdict()
    shapes = {name: np.shape(value) for name, value in {**timeline, **forces}.items()} | {"go": (), "jump": ()}
    shapes["jump_goal"] = (2,)
    steps = st.integers(-2, 9) | st.just(NEVER) | st.lists(st.integers(0, 9), min_size=n, max_size=n)
    for name in draw(st.lists(st.sampled_from([*shapes]), min_size=1, max_size=2)):
        kind = timeline if name in timeline else forces
        shape, scale = (n, *shapes[name]), draw(st.sampled_from([2, 2, 2, 200]))
        kind[name] = draw(steps | anything(shape, 0, 9) if name in ("go", "jump") else anything(shape, 0, scale))
    whole = st.sampled_from([Timeline(**timeline), Timeline(**timeline), None, (0, 0, 0), no_forces()])
    both = st.sampled_from([HandForces(**forces), HandForces(**forces), HandForces(**forces), None, "forces"])
    return draw(whole), draw(both)


@st.composite
def starts(draw: Any, noisy: bool, rich: bool) -> tuple[Any, ...]:
    """Arms, their trials, their noise, and the actions of a step."""
    arms = draw(
        st.lists(st.integers(0, N - 1), max_size=N, unique=True) | st.lists(st.integers(-1, N)) | anything((N,))
    )
    k = len(arms) if isinstance(arms, list) else N
    noise = st.just(np.ones((k, LENGTH + 1, 20))) if noisy else st.none()
    other = anything((k, LENGTH + 1, 20)) | st.none()
    return arms, draw(trials(k, rich)), draw(noise | noise | other), draw(anything((N, 6)))


@st.composite
def torch_steps(draw: Any) -> tuple[Any, ...]:
    """What the torch operation takes, one thing of which may be anything, or all."""
    shapes = [(N, 4), (N, 7, 6), (N, 6), (N, 2), (N, 4)]
    given = [torch.rand(shape) for shape in shapes]
    for i in draw(st.sampled_from([(0,), (1,), (2,), (3,), (2, 4), range(5)])):
        given[i] = draw(tensors(shapes[i]))
    return draw(st.booleans()), *given


def changes(clocks: st.SearchStrategy[int]) -> st.SearchStrategy[Callable[[Any], Any]]:
    """Changes of one number of an array that is sound."""

    @st.composite
    def change(draw: Any) -> Callable[[Any], Any]:
        place, number, nan = draw(st.integers(0, 10_000)), draw(clocks), draw(st.booleans())

        def changed(array: Any) -> Any:
            array = np.zeros(1) if array is None else array
            with np.errstate(all="ignore"):
                value = np.nan if nan and array.dtype.kind == "f" else np.array(number).astype(array.dtype)
            array.reshape(-1)[place % array.size] = value
            return array

        return changed

    return change()
