"""Work shared among processes: the same results in the same order, and no process left behind."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lib import forks

ROOT = Path(__file__).parents[1]


@pytest.fixture
def three():
    before = forks.allow(3)
    yield
    forks.allow(before)


def squared_by(k):
    time.sleep(0.002)
    return k * k, os.getpid()


@pytest.mark.parametrize("together", [1, 7])
def test_results_come_in_order_from_as_many_processes_as_are_allowed(three, together):
    found = forks.mapped(squared_by, range(200), together=together)
    assert [square for square, _ in found] == [k * k for k in range(200)]
    assert len({who for _, who in found}) == 3 and os.getpid() in {who for _, who in found}


def test_items_that_belong_together_stay_with_one_process(three):
    who = [pid for _, pid in forks.mapped(squared_by, range(100), together=10)]
    assert all(len(set(who[k : k + 10])) == 1 for k in range(0, 100, 10))


def test_few_items_and_one_core_stay_here(three):
    here = os.getpid()
    assert {who for _, who in forks.mapped(squared_by, range(forks.FEW))} == {here}
    assert {who for _, who in forks.mapped(squared_by, range(3), few=3)} == {here}
    forks.allow(1)
    assert {who for _, who in forks.mapped(squared_by, range(100))} == {here}


def test_more_items_than_a_pipe_holds_numbers(three):
    n = 3 * forks.MOST + 5
    assert forks.mapped(lambda k: k + 1, range(n)) == list(range(1, n + 1))


def test_results_may_be_larger_than_a_pipe(three):
    found = forks.mapped(lambda k: np.full(100_000, k), range(12), few=1)
    assert [int(array[-1]) for array in found] == list(range(12))


def test_the_first_fault_in_order_is_raised_whoever_met_it(three):
    def fails(k):
        if k in (30, 60):
            raise ValueError(f"item {k}")
        return k

    with pytest.raises(ValueError, match="item 30"):
        forks.mapped(fails, range(100))


def test_a_process_that_is_killed_is_no_result(three):
    here = os.getpid()

    def dies(k):
        time.sleep(0.002)
        if os.getpid() != here:
            os.kill(os.getpid(), signal.SIGKILL)
        return k

    before = children()
    with pytest.raises(RuntimeError, match="status -9"):
        forks.mapped(dies, range(100))
    assert children() == before


def children():
    """Numbers of the children of this process."""
    return Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()


def test_what_can_not_be_sent_ends_the_job_and_says_why(three, capfd):
    with pytest.raises(RuntimeError, match="status 1"):
        forks.mapped(lambda k: time.sleep(0.002) or (lambda: k), range(100))
    assert "pickle" in capfd.readouterr().err


def test_none_works_on_for_a_process_that_is_gone(tmp_path):
    """The parent is killed without a word; its children stop after the item at hand."""
    code = f"""
import os, sys, time
sys.path.insert(0, {str(ROOT)!r})
from lib import forks
def work(k):
    open({str(tmp_path)!r} + f"/{{os.getpid()}}", "a").write("x")
    time.sleep(0.05)
forks.allow(3)
forks.mapped(work, range(10_000))
"""
    parent = subprocess.Popen([sys.executable, "-c", code])
    _until(lambda: len(list(tmp_path.iterdir())) == 3)
    parent.kill()
    parent.wait()
    children = [int(path.name) for path in tmp_path.iterdir() if int(path.name) != parent.pid]
    _until(lambda: not any(_is_alive(child) for child in children))


def _until(holds):
    for _ in range(600):
        if holds():
            return
        time.sleep(0.05)
    pytest.fail("waited for 30 s")


def _is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
