"""``python -m bilateral_rl.zoo`` answers who calls it wrongly."""

import runpy
import sys

import pytest

from bilateral_rl.io.errors import UserError
from bilateral_rl.zoo.__main__ import main


def test_it_says_what_to_do(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["zoo"])
    monkeypatch.delitem(sys.modules, "bilateral_rl.zoo.__main__", raising=False)
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("bilateral_rl.zoo", run_name="__main__")
    assert ended.value.code == 2
    assert "python -m bilateral_rl.zoo train --algo hemispheric_ppo" in capsys.readouterr().err


def test_an_unknown_command(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["zoo", "teach"])
    with pytest.raises(UserError, match="Unknown command 'teach'; choose from train, enjoy"):
        main()


def test_without_rl_zoo3(monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] == "rl_zoo3"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rl_zoo3", None)
    monkeypatch.setattr(sys, "argv", ["zoo", "train"])
    with pytest.raises(
        UserError, match=r'rl_zoo3 is not installed; get it with `pip install -c constraints.txt -e "\.\[zoo\]"`'
    ):
        main()
