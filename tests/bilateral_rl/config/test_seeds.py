import pytest

from bilateral_rl.config.schema import MAX_SEED
from bilateral_rl.config.seeds import parse_seeds
from bilateral_rl.io.errors import UserError


@pytest.mark.parametrize(
    ("text", "settings"),
    [
        ("10", {"seeds": 10}),
        ("1000", {"seeds": 1000}),
        ("100..129", {"seed": 100, "seeds": 30}),
        ("0..4", {"seed": 0, "seeds": 5}),
        ("7..7", {"seed": 7, "seeds": 1}),
        ("0..999", {"seed": 0, "seeds": 1000}),
        (f"{MAX_SEED}..{MAX_SEED}", {"seed": MAX_SEED, "seeds": 1}),
    ],
)
def test_seeds_are_a_number_or_the_first_and_the_last_one(text, settings):
    assert parse_seeds(text).settings == settings


OTHER = ["", "many", "2.5", "a..b", "3..", "..3", "-5..3", "1..-3", "1...3", "1..3..5", "100-129", "1..3\n", "٣..٤"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0", "at least 1, got 0"),
        ("-3", "at least 1, got -3"),
        ("1001", "at most 1,000, got 1,001"),
        ("0..1000", "at most 1,000, got 1,001"),
        ("5..3", r"as 3\.\.5, not 5\.\.3"),
        (f"{MAX_SEED}..{MAX_SEED + 1}", "seeds up to 4,294,967,295, not 4,294,967,296"),
        *(
            (text, "takes how many, such as 10, or the first and the last one, such as 100")
            for text in (*OTHER, "9" * 5000)
        ),
    ],
)
def test_other_texts_are_refused_in_a_sentence(text, message):
    with pytest.raises(UserError, match=f"^--seeds .*{message}"):
        parse_seeds(text)


def test_the_first_seed_is_named_once():
    assert parse_seeds("30", besides="--seed").settings == {"seeds": 30}
    with pytest.raises(UserError, match=r"^--seeds 0\.\.4 names the first seed, and so does --seed: leave one of them"):
        parse_seeds("0..4", besides="--seed")
