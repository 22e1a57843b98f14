"""Errors in Python name arguments and calls; on the command line the same ones name options and commands."""

import pytest

from bilateral_rl.api.wording import in_python, python_words
from bilateral_rl.io.errors import UserError


@pytest.mark.parametrize(
    ("sentence", "words"),
    [
        ("Choose another --out.", "Choose another `out`."),
        ("--trials must be at least 1, got 0.", "`trials` must be at least 1, got 0."),
        ("leave algo out of --grid and --set.", "leave algo out of `grid` and `settings`."),
        ("use --retrain-optimizer fresh.", "use `retrain_optimizer` fresh."),
        ("which this run has; use --no-retrain.", 'which this run has; use `retrain="none"`.'),
        ("a--b and --- stay.", "a--b and --- stay."),
        ("start one with `ray start --head`, or --jobs 2.", "start one with `ray start --head`, or `jobs` 2."),
        ("`bilateral-rl list` shows those there are.", "`bilateral_rl.list_runs()` shows those there are."),
        ("`bilateral-rl train` makes one.", "`bilateral_rl.train()` makes one."),
        ("begin by `bilateral-rl train --init-from 'a b'`.", "begin by `bilateral_rl.train(init_from='a b')`."),
        ("`bilateral-rl train --resume runs/x`", "`bilateral_rl.load('runs/x').resume()`"),
        (
            "call `bilateral-rl lesion runs/x:3 --lesion callosum --lesion deep_dominant --no-control --trials 16`.",
            "call `run = bilateral_rl.load('runs/x:3'); run.lesion(lesions=['callosum', 'deep_dominant'], "
            "control=False, trials=16, out=run.lesions_folder)`.",
        ),
        (
            "`bilateral-rl lesion runs/x --no-retrain`",
            "`run = bilateral_rl.load('runs/x'); run.lesion(retrain=\"none\", out=run.lesions_folder)`",
        ),
        ("written by `bilateral-rl render`", "written by `bilateral-rl render`"),
    ],
)
def test_sentences(sentence, words):
    assert python_words(sentence) == words


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("sensory_noise", r"test\(\) has no argument 'sensory_noise': give settings=\{'trial.sensory_noise': …\}"),
        ("noise", "unexpected keyword argument 'noise'"),
    ],
)
def test_a_setting_given_as_an_argument_is_told_where_it_goes(name, says):
    @in_python
    def test(trials, *, settings=None):
        raise AssertionError

    with pytest.raises(TypeError, match=says):
        test(2, **{name: 0.02})


def test_an_error_keeps_its_kind_and_what_the_command_line_says():
    class OddError(UserError, ValueError):
        pass

    @in_python
    def refuse():
        raise OddError("choose another --out.")

    @in_python
    def outer():
        refuse()

    with pytest.raises(OddError, match=r"^choose another `out`\.$") as refusal:
        outer()
    assert refusal.value.on_command_line == "choose another --out."
