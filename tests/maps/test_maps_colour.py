"""The sRGB transfer of IEC 61966-2-1."""

import numpy as np

from lib.maps.colour import linear_to_srgb, srgb_to_linear


def test_published_values():
    # 8-bit codes and their linear light; 188 is the code of half the light to a quarter of a code
    assert np.allclose(
        srgb_to_linear(np.array([0, 10, 11, 128, 188, 255]) / 255),
        [0, 0.003035269, 0.003346536, 0.215860500, 0.502886458, 1],
        atol=1e-8,
    )
    assert abs(linear_to_srgb(0.5) * 255 - 187.516) < 1e-3


def test_there_and_back_for_every_code():
    codes = np.arange(65536) / 65535
    assert np.abs(linear_to_srgb(srgb_to_linear(codes)) - codes).max() < 1e-7  # the two pieces meet to 3e-8
    assert (np.diff(srgb_to_linear(codes)) > 0).all()


def test_clipping_and_type():
    assert linear_to_srgb(np.array([-1, 2.0])).tolist() == [0, 1]
    assert srgb_to_linear(np.float32([0.5])).dtype == np.float32
