"""The hard cases of light transport at cheap settings: every figure of benchmarks/hard_cases holds."""

import pytest

from benchmarks import accuracy


@pytest.mark.parametrize("name", accuracy.CASES)
def test_hard_case(tmp_path, name):
    figures, _ = accuracy.measured(accuracy.CASES[name], tmp_path, is_cheap=True)
    failed = [f"{f.what}: {f.achieved:.3g}, asked {f.asked:.3g} ({f.truth})" for f in figures if not f.holds]
    assert figures and not failed, "\n".join(failed)
