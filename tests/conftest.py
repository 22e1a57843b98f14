import signal

import pytest
import torch

pytest_plugins = ["supervised_fixtures", "video_fixtures"]


@pytest.fixture(autouse=True, scope="session")
def one_torch_thread():
    """Networks this small only lose time to threads, on a busy machine most of it."""
    torch.set_num_threads(1)


@pytest.fixture(autouse=True, scope="session")
def sigint_interrupts():
    """As in a program of one's own; pytest-xdist's workers ignore it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
