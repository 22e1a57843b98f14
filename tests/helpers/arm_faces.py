"""What the tests of the arm's three faces share: settings to try, and bitwise equality of what they return."""

import numpy as np
import pytest
from rich_tasks import RICH_SETTINGS

SETTINGS = {
    "plain": {},
    "noisy and delayed": {"sensory_noise": 0.01, "motor_noise": 0.05, "feedback_delay": 2},
    "senses and losses of one's own": RICH_SETTINGS,
}
each_setting = pytest.mark.parametrize("settings", SETTINGS.values(), ids=SETTINGS.keys())


def assert_same(first, second):
    """Bitwise, through tuples, lists and dictionaries; a nan equals a nan."""
    assert type(first) is type(second)
    if isinstance(first, dict):
        assert list(first) == list(second)
        for key in first:
            assert_same(first[key], second[key])
    elif isinstance(first, (tuple, list)):
        for a, b in zip(first, second, strict=True):
            assert_same(a, b)
    else:
        np.testing.assert_array_equal(first, second, strict=isinstance(first, np.ndarray))
