"""Drawings whose lines can be counted by hand."""

import re
import xml.etree.ElementTree as ET

import pytest

from lib.report.charts import convergence, standalone, tree_lines


def test_tree_with_one_divided_corner():
    # v up:  +---+---+      leaves of level 1 except the lower left one, which has four of level 2
    #        |   |   |
    #        +-+-+---+
    #        +-+-+   |
    #        +-+-+---+
    level = [1, 1, 1, 2, 2, 2, 2]
    i = [1, 0, 1, 0, 1, 0, 1]
    j = [0, 1, 1, 0, 0, 1, 1]
    path, w, h = tree_lines(level, i, j, (1, 1))
    assert (w, h) == (4, 4)
    segments = set(re.findall(r"M(\d+) (\d+)([hv])(\d+)", path))
    assert segments == {
        ("0", "0", "h", "4"),
        ("0", "2", "h", "4"),
        ("0", "3", "h", "2"),
        ("0", "4", "h", "4"),
        ("0", "0", "v", "4"),
        ("1", "2", "v", "2"),
        ("2", "0", "v", "4"),
        ("4", "0", "v", "4"),
    }


def test_a_full_tree_costs_two_lines_a_row():
    n = 32
    path, w, h = tree_lines([5] * n * n, [k % n for k in range(n * n)], [k // n for k in range(n * n)], (1, 1))
    assert (w, h) == (n, n) and path.count("M") == 2 * (n + 1)


def test_root_grid_that_is_not_square():
    path, w, h = tree_lines([0, 0, 0], [0, 1, 2], [0, 0, 0], (3, 1))
    assert (w, h) == (3, 1) and path == "M0 0h3M0 1h3M0 0v1M1 0v1M2 0v1M3 0v1"


def test_convergence_is_an_svg_with_a_point_a_round():
    svg = convergence([0, 10, 20], [1.0, 0.1, 0.0009], 1e-3)
    root = ET.fromstring(svg)
    assert len([x for x in root.iter() if x.tag == "circle"]) == 3
    assert "stop at 0.001" in svg


@pytest.mark.parametrize("shots, unshot", [([], []), ([0], [1.0]), ([0, 1], [0.0, 0.0])])
def test_nothing_to_draw(shots, unshot):
    assert convergence(shots, unshot) == ""


def test_a_chart_of_its_own_is_a_whole_svg_file():
    whole = ET.fromstring(standalone(convergence([0, 5, 9], [1.0, 0.1, 0.001], 1e-3)))
    assert whole.tag == "{http://www.w3.org/2000/svg}svg" and len(whole.findall(".//{*}circle")) == 3
    assert ET.fromstring(standalone("")).tag.endswith("svg")
