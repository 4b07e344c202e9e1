"""The accuracy of the bake on hard cases: `make accuracy`, or python benchmarks/accuracy.py --help.

Every case of benchmarks/hard_cases is baked through the stages' doors at the default settings and compared with its
truth, a closed form or an identity. Writes benchmarks/accuracy.md; the exit status is 1 if a figure does not hold.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from benchmarks.hard_cases import (  # noqa: E402
    accounts,
    closed,
    contacts,
    curved,
    lamps,
    near,
    resampling,
    scale,
    seams,
    shadows,
)
from benchmarks.hard_cases.bench import Bench  # noqa: E402

TOPICS = closed, accounts, near, shadows, contacts, curved, seams, lamps, scale, resampling
CASES = {f.__name__: f for topic in TOPICS for f in topic.CASES}
HEAD = """# Accuracy on hard cases

Made by `make accuracy`: each case baked through the stages at the default settings (tolerance 1 %). Errors are
relative unless the truth says otherwise; a case's CPU seconds cover all its bakes and their truth, on one core.

| case | truth | asked | achieved | CPU s |
| --- | --- | ---: | ---: | ---: |
"""


def measured(case, folder, is_cheap=False):
    """Figures of a case, and its CPU seconds."""
    start = time.process_time()
    figures = list(case(Bench(folder, is_cheap)))
    return figures, time.process_time() - start


def rows(figures, seconds):
    """Lines of the table; the seconds stand in the first."""
    texts = [f"{seconds:.1f}", *[""] * (len(figures) - 1)]
    return [
        f"| {f.what} | {f.truth} | {_number(f.asked)} | {_number(f.achieved)}{'' if f.holds else ' **fails**'} | {s} |"
        for f, s in zip(figures, texts, strict=True)
    ]


def _number(x):
    """A share in per cent; 0 as it is; nothing where nothing is asked.

    >>> _number(0.0123), _number(0), _number(float("inf")), _number(1.2e-7)
    ('1.23 %', '0', '', '1.2e-07')
    """
    if x == float("inf"):
        return ""
    if x == 0:
        return "0"
    return f"{x:.1e}" if abs(x) < 1e-5 else f"{100 * x:.3g} %"


def main(argv=None):
    """Measure, print a line as soon as it is known, write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=f"of {', '.join(CASES)}; default: all, into the file")
    parser.add_argument("--out", type=Path, default=ROOT / "benchmarks" / "accuracy.md", metavar="FILE")
    args = parser.parse_args(argv)
    unknown = [name for name in args.cases if name not in CASES]
    if unknown:
        parser.error(f"no case is called {unknown[0]}")
    lines, failed = [], 0
    for name in args.cases or CASES:
        with tempfile.TemporaryDirectory() as folder:
            figures, seconds = measured(CASES[name], Path(folder))
        failed += sum(not figure.holds for figure in figures)
        lines += rows(figures, seconds)
        print(*lines[-len(figures) :], sep="\n", flush=True)
    if not args.cases:
        args.out.write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")
    print(f"{len(lines)} figures, {failed} do not hold", file=sys.stderr)
    return int(failed > 0)


if __name__ == "__main__":
    raise SystemExit(main())
