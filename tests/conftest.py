import pytest
import torch


@pytest.fixture(autouse=True, scope="session")
def one_torch_thread():
    """Networks this small only lose time to threads, on a busy machine most of it."""
    torch.set_num_threads(1)
