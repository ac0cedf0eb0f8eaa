"""The exposure that a picture asks for."""

from __future__ import annotations

import numpy as np
import pytest

from ssil_viewer.metering import HIGHLIGHTS, MIDDLE_GREY, metered_exposure


def picture(*parts):
    """(10, 10, 3) of grey, from shares of its pixels and their luminance."""
    values = np.concatenate([np.full(round(100 * share), value) for share, value in parts])
    assert values.size == 100
    return np.repeat(values, 3).reshape(10, 10, 3).astype(np.float32)


@pytest.mark.parametrize("value", [1e-4, 0.03, MIDDLE_GREY, 7.0, 900.0])
def test_a_grey_card_becomes_middle_grey(value):
    exposure = metered_exposure(picture((1.0, value)))
    assert value * 2**exposure == pytest.approx(MIDDLE_GREY, rel=0.04)     # in steps of a tenth of a stop
    assert exposure == pytest.approx(round(exposure, 1))


def test_luminance_counts_not_channels():
    green, blue = np.zeros((2, 2, 3), np.float32), np.zeros((2, 2, 3), np.float32)
    green[..., 1], blue[..., 2] = 1.0, 1.0
    assert metered_exposure(green) - metered_exposure(blue) == pytest.approx(np.log2(0.0722 / 0.7152), abs=0.11)


def test_few_black_or_bright_pixels_do_not_decide():
    plain = metered_exposure(picture((1.0, 0.05)))
    assert metered_exposure(picture((0.95, 0.05), (0.05, 1e-6))) == plain
    assert metered_exposure(np.float32([[[0.04] * 3, [0.06] * 3]])) == pytest.approx(plain, abs=0.1), "of two pixels"
    assert metered_exposure(picture((0.98, 0.05), (0.02, 1e4))) == plain


def test_highlights_do_not_burn_out():
    """A small part in the sun, as in a courtyard: the mean alone would ask for 7 stops."""
    exposure = metered_exposure(picture((0.9, 0.18 / 128), (0.1, 1.0)))
    assert exposure == pytest.approx(np.log2(HIGHLIGHTS), abs=0.05)


def test_pixels_without_light_and_without_number_do_not_count():
    image = picture((0.5, 0.1), (0.5, 0.0))
    image[0, 0], image[0, 1] = np.nan, np.inf
    assert metered_exposure(image) == metered_exposure(picture((1.0, 0.1)))


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_a_picture_without_light_is_left_as_it_is(value):
    assert metered_exposure(picture((1.0, value))) is None


def test_what_does_not_count_holds_the_highlights_alone():
    court, sky = picture((0.9, 0.01), (0.1, 1.0)), picture((0.9, 1.0), (0.1, 0.0)) > 0
    counts = sky[..., 0]
    assert metered_exposure(court, counts) == pytest.approx(np.log2(HIGHLIGHTS), abs=0.05)
    assert metered_exposure(picture((0.9, 0.05), (0.1, 0.5)), counts) == metered_exposure(picture((1.0, 0.05)))
    assert metered_exposure(picture((1.0, 0.05)), np.zeros((10, 10), bool)) == metered_exposure(picture((1.0, 0.05)))


def test_the_exposure_stays_in_the_range_of_the_setting():
    assert metered_exposure(picture((1.0, 1e-9))) == 16.0
    assert metered_exposure(picture((1.0, 1e9))) == -16.0
