"""Every public door to a kernel, with inputs for it."""

from __future__ import annotations

import contextlib
import dataclasses
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
import warp as wp
from door_inputs import (
    LENGTH,
    SCALARS,
    N,
    anything,
    changes,
    choice,
    starts,
    tensors,
    torch_steps,
    trials,
    trials_of_two_arms,
)
from given_actions import acting
from hypothesis import strategies as st
from hypothesis.extra import numpy as np_st
from rich_tasks import RICH_SETTINGS, no_forces

from bilateral_rl.analysis.trials import Evaluator, NotFiniteError
from bilateral_rl.bptt.trials import training_trials
from bilateral_rl.envs import (
    Arm,
    ArmEnv,
    ArmState,
    ArmVecEnv,
    ArmVectorEnv,
    RandomReach,
    Task,
    Trials,
    TrialSettings,
)
from bilateral_rl.envs.arm.kernels import arm_kernels
from bilateral_rl.envs.arm.warp_start import start_warp
from bilateral_rl.envs.measures import trial_measures
from bilateral_rl.envs.task import Spring, Timeline
from bilateral_rl.envs.trial_arrays import Features, TrialRows, vec2
from bilateral_rl.envs.trial_kernels import trial_kernels
from bilateral_rl.envs.trials import TrialBatch

WORKS, REFUSED = "works", "refused"


@dataclass(frozen=True)
class Door:
    """What takes something of a user's."""

    call: Callable[..., object]
    inputs: st.SearchStrategy[tuple[Any, ...]]
    """Arguments for it."""
    others: tuple[type[Exception], ...] = ()
    """What it may raise beside ValueError and TypeError."""

    def outcome(self, arguments: tuple[Any, ...]) -> str:
        """Whether ``arguments`` work or are refused. Anything else that happens is a fault, and raised."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of numbers that grow out of range
            try:
                self.call(*arguments)
            except (TypeError, ValueError, *self.others) as error:
                if not str(error) or len(str(error)) > 2_000:
                    raise AssertionError(f"no sentence for people: {error!r}") from error
                return REFUSED
        return WORKS


@dataclass
class Arms:
    """Batches and environments that are tried again and again."""

    noise: float
    rich: bool = False
    batch: Any = field(init=False)
    vec_env: Any = field(init=False)
    env: Any = field(init=False)
    vector_env: Any = field(init=False)
    task: Any = field(init=False)
    pairs: Any = field(init=False)
    pair_task: Any = field(init=False)

    def __post_init__(self) -> None:
        rich = self.rich

        class Gives(Task):
            n_uniform = 4
            has_timeline = has_forces = rich
            given: tuple[Any, ...] | None = None

            def trials(self, uniform, settings):
                if self.given is None:
                    sound = np.full((len(uniform), 2), 0.5)
                    return Trials(sound, sound, sound, *((Timeline(1, 2, (1.0, 1.0)), no_forces()) if rich else ()))
                return Trials(*self.given) if len(self.given) >= 3 else self.given[0]

        class GivesPairs(Gives):
            n_arms = 2
            has_timeline = has_forces = False

            def trials(self, uniform, settings):
                if self.given is not None:
                    return super().trials(uniform, settings)
                sound = np.full((2, 2), 0.5)
                return Trials(sound, sound, sound, spring=Spring(50.0, 1.0))

        kinds = {"trial_length": LENGTH, "motor_noise": self.noise, "feedback_delay": 2}
        if rich:
            kinds = {"trial_length": LENGTH, **RICH_SETTINGS, "motor_noise": self.noise}
        self.task = Gives()
        self.batch = TrialBatch(self.task, TrialSettings(**kinds), N)
        self.vec_env, self.env = ArmVecEnv(N, self.task, seed=0, **kinds), ArmEnv(self.task, **kinds)
        self.vector_env = ArmVectorEnv(N, self.task, autoreset_mode="Disabled", **kinds)
        self.pair_task = GivesPairs()
        self.pairs = ArmVecEnv(N, self.pair_task, seed=0, trial_length=LENGTH, motor_noise=self.noise, feedback_delay=2)
        self.reset()

    def reset(self) -> None:
        """Begin anew on sound trials."""
        self.task.given = None
        self.vec_env.reset(), self.env.reset(), self.vector_env.reset()
        self.step()

    def step(self, n: int = LENGTH + 1) -> None:
        """Go on to the trials' end and further: whatever was accepted, kernels now work with it."""
        action = np.zeros((N, 6), np.float32)
        for _ in range(n):
            self.vec_env.step(action)

    def with_trials(self, door: str, *given: Any) -> None:
        self.task.given = given
        try:
            if door == "bptt":
                training_trials(0, N, self.task, self.batch.settings)
            else:
                getattr(self, door).reset()
            if door == "vec_env":
                self.step()
                joint = self.vec_env.batch.joint[:, :2]
                assert np.isfinite(joint).all(), "an arm in no posture"
        finally:
            self.task.given = None

    def with_pairs(self, *given: Any) -> None:
        self.pair_task.given = given
        try:
            self.pairs.reset()
            for _ in range(LENGTH + 1):
                self.pairs.step(np.zeros((N, 12), np.float32))
            assert np.isfinite(self.pairs.batch.joint[:, :2]).all(), "an arm in no posture"
        finally:
            self.pair_task.given = None

    def start(self, arms: Any, trials: tuple[Any, ...], noise: Any, action: Any) -> None:
        self.batch.start(arms, Trials(*trials), noise)
        with contextlib.suppress(RuntimeError):  # no arm was started
            self.batch.step(action)

    def act(self, face: str, action: Any) -> None:
        getattr(self, face).reset()
        getattr(self, face).step(action)

    def options(self, options: Any, seed: Any) -> None:
        self.env.reset(options=options, seed=seed)
        self.env.step(np.zeros(6))

    def mask(self, options: Any, seed: Any) -> None:
        self.vector_env.reset()
        self.vector_env.step(np.zeros((N, 6)))
        self.vector_env.reset(options=options, seed=seed)
        self.vector_env.step(np.zeros((N, 6)))

    def state(self, changes: dict[str, Any]) -> None:
        self.vec_env.reset()
        arrays = {name: array.copy() for name, array in self.vec_env.state_arrays().items()}
        for name, change in changes.items():
            arrays[name] = change(arrays.get(name)) if callable(change) else change
        self.vec_env.set_state_arrays(arrays)
        self.step()

    def unpickled(self, changes: dict[str, Any]) -> None:
        state = self.batch.__getstate__() | {key: value for key, value in changes.items() if key != "arrays"}
        state["arrays"] = state["arrays"] | changes.get("arrays", {})
        batch = object.__new__(type(self.batch))
        batch.__setstate__(state)
        with contextlib.suppress(RuntimeError):  # no trial is under way
            for _ in range(LENGTH + 1):
                batch.step(np.zeros((batch.n, 6)))

    def live(self, name: str, where: Any, value: Any) -> None:
        """Write into what the kernels work with, by every way that NumPy has."""
        self.vec_env.reset()
        arrays = {**self.vec_env.batch.state_arrays(), "joint": self.vec_env.batch.joint}
        try:
            arrays[name][where] = value
        except (IndexError, OverflowError) as error:
            raise ValueError(error) from None
        with contextlib.suppress(RuntimeError):  # clocks that say that all trials are over
            self.step()
        self.reset()

    def attribute(self, face: str, name: str, value: Any) -> None:
        face, *inner = face.split(".")
        target = getattr(self, face)
        for part in inner:
            target = getattr(target, part)
        kept = dict(vars(target))
        try:
            if face == "vec_env" and not inner:
                target.set_attr(name, value)
            else:
                setattr(target, name, value)
            self.step()
        finally:
            vars(target).clear()
            vars(target).update(kept)


def _forced(changes: dict[str, Any], early: bool) -> None:
    """Settings that were changed by force, before the arms were made or after."""
    settings = TrialSettings(trial_length=LENGTH)
    batch = None if early else TrialBatch(RandomReach(), settings, N)
    for name, value in changes.items():
        for target in (settings, *(() if batch is None else (batch.settings,))):
            object.__setattr__(target, name, value)
    batch = batch or TrialBatch(RandomReach(), settings, N)
    draws = batch.draw(np.random.default_rng(0), N)
    batch.start(np.arange(N), RandomReach().trials(np.full((N, 4), 0.5), batch.settings), draws.noise)
    with contextlib.suppress(RuntimeError):
        for _ in range(70):
            batch.step(np.zeros((N, 6)))


def _made(n: Any, changes: dict[str, Any]) -> None:
    """An environment of any number of arms and any settings."""
    if isinstance(n, int) and n > 1_000:
        n = 1_000  # memory is not what is tried
    env = ArmVecEnv(n, **changes)
    env.reset()
    for _ in range(3):
        env.step(np.zeros((env.num_envs, 6)))


def _evaluated(action: Any) -> None:
    with contextlib.suppress(NotFiniteError):
        Evaluator("random_reach", TrialSettings(trial_length=LENGTH), N, seed=0).run(acting(action))


def _torch_step(double: bool, joint: Any, muscle: Any, excitation: Any, load: Any, upstream: Any) -> None:
    arm = Arm(dtype=torch.float64 if double else torch.float32)
    after = arm.step(ArmState(joint, muscle, joint), excitation, load)
    if after.joint.requires_grad:
        expected = isinstance(upstream, torch.Tensor) and upstream.shape == after.joint.shape
        after.joint.backward(
            upstream.to(after.joint) if expected and not upstream.is_meta else torch.ones_like(after.joint)
        )


def _torch_rest(call: str, given: Any) -> None:
    getattr(Arm(), call)(given)


def _measured(distance: Any, start: Any, threshold: Any, onset: Any) -> None:
    trial_measures(distance, start, threshold, onset)


def trap() -> Door:
    """What no door lets by: a kernel is given one row for all its arms, and reads behind it."""
    batch = Arms(0.0).batch

    def read_behind() -> None:
        arms, rows = wp.array(np.arange(N), dtype=wp.int32), TrialRows()
        rows.start = rows.goal = rows.load = wp.zeros(1, dtype=vec2)
        wp.launch(trial_kernels(Features()).start, dim=N, inputs=[batch._p, rows, arms, *batch._structs])

    return Door(read_behind, st.just(()))


def _load_kernels() -> None:
    """Load those of the torch operation, so that no copy of this process has to; none may have been differentiated."""
    start_warp()
    for real in (wp.float32, wp.float64):
        for kernel in arm_kernels(real):
            kernel.module.load(wp.get_device("cpu"))
    torch.set_num_threads(1)


def make_doors(noise: float = 0.0, rich: bool = False) -> dict[str, Door]:
    """Every door by name.

    ``noise`` is the standard deviation of motor noise in the batches behind them, and ``rich`` says whether their
    trials have timelines and forces, senses and losses of their own.
    """
    _load_kernels()
    arms = Arms(noise, rich)
    noisy = arms.batch.settings.noisy
    actions = anything((N, 6), -1, 1)
    no_trials = st.tuples(st.recursive(SCALARS, lambda x: st.lists(x), max_leaves=4))
    states = st.sampled_from([*arms.vec_env.state_arrays(), "another"])
    clocks = st.integers(-(2**31), 2**31 - 1) | st.integers(-9, 60)
    arrays = st.dictionaries(states, st.one_of(changes(clocks), anything((N, 2))), min_size=1, max_size=2)
    batch_arrays = st.dictionaries(st.sampled_from([*arms.batch.state_arrays(), "x"]), anything((N, 2)), max_size=2)
    pickled = st.fixed_dictionaries(
        {}, optional={"n": SCALARS, "task": SCALARS, "settings": SCALARS, "device": SCALARS, "arrays": batch_arrays}
    )
    numbers = st.one_of(st.integers(0, 9), st.floats(0, 2), st.just([0.5, 0.5]), SCALARS, anything((2,)))
    names = [field.name for field in dataclasses.fields(TrialSettings)]
    loss = st.dictionaries(st.sampled_from(["cartesian_1", "hand_speed", "x"]), numbers, max_size=2)
    losses = st.dictionaries(
        st.sampled_from(["dominant", "non_dominant", "last_steps", "x"]), loss | numbers, max_size=2
    )
    arm = st.dictionaries(st.sampled_from(["timestep", "link_length", "joint_upper_limit", "x"]), numbers, max_size=2)
    chosen = st.dictionaries(st.sampled_from([*names, "seed", "device", "task"]), numbers | arm | losses, max_size=3)
    small = st.dictionaries(st.sampled_from(names), st.integers(-2, 70) | SCALARS, min_size=1, max_size=2)
    where = st.one_of(st.just(...), st.integers(-2, N), st.just((slice(None), 0)))
    live = st.sampled_from([*arms.batch.state_arrays()])
    attributes = st.sampled_from(
        [*names, "settings", "batch", "task", "n", "num_envs", "n_uniform", "joint", "clock", "noise"]
    )
    faces = st.sampled_from(["vec_env", "vec_env.batch", "env", "env.batch", "vector_env"])
    faces_of_steps = st.sampled_from(["vec_env", "env", "vector_env"])
    pair = anything((2,))
    options = st.fixed_dictionaries({"start": pair}, optional={"goal": pair, "load": pair, "x": SCALARS})
    mask = st.fixed_dictionaries({}, optional={"reset_mask": anything((N,)) | np_st.arrays(bool, N), "x": SCALARS})
    at_rest = choice(st.tuples(st.just("rest"), tensors((N, 2))), st.tuples(st.just("state"), tensors((N, 4))))
    onsets = st.none() | st.just([0, 1, LENGTH]) | anything((N,))
    many, one = (st.tuples(trials(n, rich) | no_trials) for n in (N, 1))
    return {
        "a task's trials, many arms": Door(lambda t: arms.with_trials("vec_env", *t), many),
        "a task's trials, one arm": Door(lambda t: arms.with_trials("env", *t), one),
        "a task's trials, supervised": Door(lambda t: arms.with_trials("bptt", *t), many),
        "a task's trials, two arms": Door(lambda t: arms.with_pairs(*t), st.tuples(trials_of_two_arms(N) | no_trials)),
        "start": Door(arms.start, starts(noisy, rich)),
        "an action": Door(arms.act, st.tuples(faces_of_steps, actions | anything((6,)))),
        "reset's options": Door(arms.options, st.tuples(options | SCALARS, st.none() | st.integers(0, 9) | SCALARS)),
        "reset's mask": Door(arms.mask, st.tuples(mask | SCALARS, SCALARS | st.lists(SCALARS, max_size=4))),
        "a saved state": Door(arms.state, st.tuples(arrays)),
        "a pickle": Door(arms.unpickled, st.tuples(pickled), (AttributeError,)),
        "live arrays": Door(arms.live, st.tuples(live, where, clocks | anything((N, 2)))),
        "attributes": Door(arms.attribute, st.tuples(faces, attributes, numbers), (AttributeError,)),
        "settings by force": Door(_forced, st.tuples(small, st.booleans()), (RuntimeError, AttributeError)),
        "settings": Door(_made, st.tuples(st.integers(1, 5) | st.integers(1, 5) | SCALARS, chosen)),
        "a policy's actions": Door(_evaluated, st.tuples(actions)),
        "the torch operation": Door(_torch_step, torch_steps()),
        "the arm at rest": Door(_torch_rest, at_rest),
        "measures": Door(_measured, st.tuples(anything((N, LENGTH)), anything((N,)), SCALARS, onsets)),
    }  # fmt: skip
