import pytest

import bilateral_rl as brl


@pytest.fixture
def loaded(bptt_run):
    """A run of seeds 0 to 2, in Python."""
    return brl.load(bptt_run.path)
