"""ArmParameters takes physical constants only, and says what is wrong with others."""

import dataclasses
import math

import pytest
import torch

from bilateral_rl.envs import Arm, ArmParameters

FIELDS = {field.name: field.default for field in dataclasses.fields(ArmParameters)}
TUPLES = [name for name, default in FIELDS.items() if isinstance(default, tuple)]
NEVER_NEGATIVE = [
    "timestep", "link_mass", "link_center_of_mass", "link_inertia", "link_length", "max_isometric_force",
    "tendon_length", "optimal_muscle_length", "normalized_slack_muscle_length", "normalized_max_velocity",
    "min_activation", "tau_activation", "tau_deactivation", "active_width", "min_active_force_length", "hill_a",
    "hill_b", "low_activation", "low_activation_origin", "low_activation_drop", "lengthening_force",
    "lengthening_slope_ratio", "lengthening_asymptote_slope",
]  # fmt: skip


def with_value(name, value):
    """The default of ``name`` with (the first of) its number(s) replaced."""
    default = FIELDS[name]
    return (value, *default[1:]) if isinstance(default, tuple) else value


def test_every_number_must_be_finite():
    for name in FIELDS:
        for value in (math.nan, math.inf, -math.inf, None, "one", True):
            with pytest.raises(ValueError, match=name):
                ArmParameters(**{name: with_value(name, value)})


def test_a_tuple_has_a_number_for_each_joint_or_muscle():
    for name in TUPLES:
        for wrong in (FIELDS[name][:-1], (*FIELDS[name], 1.0), FIELDS[name][0]):
            with pytest.raises(ValueError, match=name):
                ArmParameters(**{name: wrong})


def test_a_negative_number_is_rejected_where_physics_has_none():
    for name in NEVER_NEGATIVE:
        with pytest.raises(ValueError, match=name):
            ArmParameters(**{name: with_value(name, -0.1)})


def test_zero_is_rejected_where_the_arm_divides_by_it():
    divisors = "timestep link_mass link_inertia max_isometric_force optimal_muscle_length tau_activation"
    for name in divisors.split():
        with pytest.raises(ValueError, match=name):
            ArmParameters(**{name: with_value(name, 0.0)})


def test_numbers_that_contradict_each_other_are_rejected():
    for changes, message in (
        ({"joint_lower_limit": (0.0, 3.0)}, "joint_lower_limit"),
        ({"min_activation": 1.0}, "min_activation"),
        ({"min_activation": 0.0}, "min_activation"),
        ({"normalized_slack_muscle_length": 1.7}, "normalized_slack_muscle_length"),
        ({"low_activation": 0.005}, "low_activation"),  # the two between which hill_b falls
        ({"lengthening_force": 1.0}, "lengthening_force"),  # a lengthening muscle resists more
    ):
        with pytest.raises(ValueError, match=message):
            ArmParameters(**changes)


def test_an_unknown_name_is_rejected():
    with pytest.raises(ValueError, match="mass"):
        ArmParameters(mass=1.0)


def test_parameters_are_immutable_and_hashable():
    parameters = ArmParameters()
    with pytest.raises(dataclasses.FrozenInstanceError):
        parameters.timestep = 0.02
    assert hash(parameters) == hash(ArmParameters())


def test_defaults_are_the_papers():
    parameters = ArmParameters()
    assert parameters.timestep == 0.01
    assert parameters.link_length == (0.309, 0.333)
    assert parameters.joint_upper_limit == pytest.approx((2.356194, 2.705260), abs=1e-6)
    assert parameters.max_isometric_force == (838, 1207, 1422, 1549, 414, 603)
    assert parameters.normalized_slack_muscle_length == 1.0
    assert parameters.min_activation == 0.001


def test_every_parameter_reaches_the_arm():
    """A changed parameter changes a short movement (the two left out matter as one curve, tested by parity)."""
    joint = torch.tensor([[0.7, 0.9, 1.0, -1.0], [1.9, 2.0, -1.0, 1.0], [0.0, 0.0, -1.0, -1.0], [2.35, 2.7, 2.0, 2.0]])
    excitation = torch.linspace(0, 1, 24).reshape(4, 6)

    def movement(parameters):
        arm = Arm(parameters)
        state = arm.state(joint)
        for _ in range(3):
            state = arm.step(state, excitation)
        return torch.cat([t.flatten() for t in state])

    def changed(name, default):
        if name == "joint_lower_limit":
            return (0.05, 0.05)
        return tuple(0.97 * v + 1e-3 for v in default) if isinstance(default, tuple) else 0.9 * default

    usual = movement(ArmParameters())
    for name in FIELDS.keys() - {"low_activation_origin", "low_activation_drop"}:
        other = ArmParameters(**{name: changed(name, FIELDS[name])})
        assert not torch.equal(movement(other), usual), name
