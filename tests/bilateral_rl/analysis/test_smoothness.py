import math
import warnings

import numpy as np
import pytest

from bilateral_rl.analysis.smoothness import ldlj, sparc

DT = 0.01
TIME = np.arange(-1, 1, DT)
BELL = np.exp(-5 * TIME**2)


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings(), np.errstate(all="raise"):
        warnings.simplefilter("error")
        yield


def minimum_jerk(n):
    t = np.arange(n) / n
    return 30 * t**2 * (1 - t) ** 2


def submovements(n):
    return sum(np.exp(-60 * (TIME + 0.6 - 0.4 * i) ** 2) for i in range(n))


def spectral_arc_length(speed, dt):
    """SPARC, its definition written out: a sum for each frequency, no Fourier transform of a library."""
    df = 1 / (dt * 2 ** (math.ceil(math.log2(len(speed))) + 4))
    frequencies = [k * df for k in range(int(10 / df) + 1)]
    amplitudes = [abs(sum(v * np.exp(-2j * np.pi * f * i * dt) for i, v in enumerate(speed))) for f in frequencies]
    largest = max(amplitudes)
    last = max(k for k, amplitude in enumerate(amplitudes) if amplitude >= 0.05 * largest)
    return -sum(math.hypot(1 / last, (amplitudes[k + 1] - amplitudes[k]) / largest) for k in range(last))


def test_sparc_is_that_of_the_public_reference_implementation():
    assert f"{sparc(BELL, DT):.5f}" == "-1.41403"


def test_ldlj_is_that_of_the_public_reference_implementation():
    assert f"{ldlj(BELL, DT):.5f}" == "-5.81636"


def test_sparc_is_its_definition():
    for length in (30, 50, 64):
        speed = np.random.default_rng(length).random(length)
        assert sparc(speed, DT) == pytest.approx(spectral_arc_length(speed, DT), rel=1e-9)


def test_sparc_counts_an_amplitude_that_comes_back_over_the_threshold():
    speed = 1 + 0.3 * np.cos(2 * np.pi * 8 * TIME)  # nothing between 0 and 8 Hz but side lobes
    assert sparc(speed, DT) == pytest.approx(spectral_arc_length(speed, DT), rel=1e-9)
    assert sparc(speed, DT) < sparc(np.ones_like(speed), DT)


def test_sparc_ignores_what_is_above_ten_hertz():
    fast = 0.9 * np.cos(2 * np.pi * 30 * TIME) * BELL
    assert sparc(BELL + fast, DT) == pytest.approx(sparc(BELL, DT), rel=1e-5)


def test_sampling_below_twenty_hertz_has_a_spectrum_up_to_its_nyquist_frequency():
    speed = np.exp(-5 * np.arange(-1, 1, 0.1) ** 2)
    assert sparc(speed, 0.1) == pytest.approx(sparc(BELL, DT), rel=0.01)


def test_ldlj_of_a_minimum_jerk_movement_is_its_integral():
    # v = 30 t² (1 − t)² has a peak of 15/8 and ∫ v̈² = 720.
    assert ldlj(minimum_jerk(20_000), 1 / 20_000) == pytest.approx(-math.log(720 / (15 / 8) ** 2), abs=1e-3)


def test_smoothness_does_not_depend_on_the_size_of_a_movement():
    for smoothness in (sparc, ldlj):
        assert smoothness(37.5 * BELL, DT) == pytest.approx(smoothness(BELL, DT))


def test_ldlj_does_not_depend_on_the_pace_of_a_movement():
    assert ldlj(BELL, 3 * DT) == pytest.approx(ldlj(BELL, DT))


def test_more_submovements_are_less_smooth():
    for smoothness in (sparc, ldlj):
        values = [float(smoothness(submovements(n), DT)) for n in (1, 2, 3, 4)]
        assert values == sorted(values, reverse=True)
        assert len(set(values)) == 4


def test_trials_are_measured_side_by_side():
    for smoothness in (sparc, ldlj):
        speed = np.stack([submovements(n) for n in (1, 2, 3)] + [BELL])
        alone = [smoothness(one, DT) for one in speed]
        np.testing.assert_allclose(smoothness(speed, DT), alone, rtol=1e-12)
        np.testing.assert_allclose(smoothness(speed.reshape(2, 2, -1), DT), np.reshape(alone, (2, 2)), rtol=1e-12)


def test_a_hand_that_never_moves_and_a_nan_have_no_smoothness_and_leave_the_others_alone():
    for smoothness in (sparc, ldlj):
        broken = BELL.copy()
        broken[50] = np.nan
        values = smoothness(np.stack([BELL, np.zeros_like(BELL), broken]), DT)
        assert values[0] == pytest.approx(smoothness(BELL, DT))
        assert np.isnan(values[1:]).all()


def test_a_constant_speed_has_no_ldlj():
    assert np.isnan(ldlj(np.ones(50), DT))


def test_a_spectrum_of_frequency_zero_alone_has_no_sparc():
    assert np.isnan(sparc(BELL, 1e-9))  # the grid's second frequency is above 10 Hz
