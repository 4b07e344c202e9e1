"""The same work on many independent items by several processes: forks of this one, which know all that it knows.

A stage may use as many cores as its rule is given (`allow`, by lib.door).  Items are handed out one by one, in order,
to whoever is free; what comes back hangs on the item alone, so the number of processes changes no result.  Not for work
that starts threads before: a fork has none of them.
"""

import os
import pickle
import signal
import sys
import tempfile
import traceback
import warnings
from contextlib import suppress

FEW = 48  # items of some milliseconds that are not worth a process
WIDTH = 4  # bytes of an item's number in the queue
MOST = 1024  # numbers in the queue: 4 kB, which every pipe holds

_allowed = 1  # of the process, as OMP_NUM_THREADS would be: how many it is changes no result, and lib knows no settings


def allow(cores):
    """Use up to `cores` processes from now on, this one among them; returns how many it were before."""
    global _allowed
    before, _allowed = _allowed, max(1, int(cores))
    return before


def mapped(function, items, few=FEW, together=1):
    """[function(item) for item in items], by as many processes as are allowed if there are more than `few` items.

    together : items that follow each other and share work are handed out so many at a time

    What the function returns is pickled; what it does besides is lost, or done in this process: nothing may hang on it.

    Raises what it raised for the first item in order, RuntimeError where a process ended on the way.
    """
    items = list(items)
    workers = min(_allowed, len(items))
    if workers < 2 or len(items) <= few or not hasattr(os, "fork"):
        return [function(item) for item in items]
    step = max(together, -(-len(items) // MOST))
    files, children = [tempfile.TemporaryFile() for _ in range(workers - 1)], []
    queue = _queue(range(0, len(items), step))
    sys.stdout.flush()
    sys.stderr.flush()
    try:
        for file in files:
            with suppress(OSError):  # no room for another process: the others do its part
                children.append(_forked(queue, function, items, step, file))
        done = dict(_worked(queue, function, items, step))
        _wait(children)
        for file in files:
            file.seek(0)
            done.update(_read(file))
    finally:
        for child in children:
            with suppress(OSError):
                os.kill(child, signal.SIGTERM)
                os.waitpid(child, 0)
        os.close(queue)
        for file in files:
            file.close()
    if len(done) < len(items):
        raise RuntimeError("a process of this job ended before its work was done")
    # What failed is done again here, and raises from where it stands in the code.
    return [done[k][1] if done[k][0] else function(items[k]) for k in range(len(items))]


def _queue(numbers):
    """The end of a pipe that numbers are read from, each by one process, to the end."""
    out, into = os.pipe()
    os.write(into, b"".join(number.to_bytes(WIDTH, sys.byteorder) for number in numbers))
    os.close(into)
    return out


def _worked(queue, function, items, step):
    """(number, (is_done, result)) of the items that this process got hold of."""
    while number := os.read(queue, WIDTH):
        first = int.from_bytes(number, sys.byteorder)
        for k in range(first, min(first + step, len(items))):
            try:
                yield k, (True, function(items[k]))
            except Exception:
                yield k, (False, None)


def _forked(queue, function, items, step, file):
    """The number of a child that works and writes what came out into `file`."""
    parent = os.getpid()
    with warnings.catch_warnings():  # of threads that the child will not have: see above
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child:
        return child
    status = 1
    try:
        for result in _worked(queue, function, items, step):
            pickle.dump(result, file, protocol=pickle.HIGHEST_PROTOCOL)
            if os.getppid() != parent:
                break
        file.flush()
        status = 0
    except KeyboardInterrupt:  # the parent hears it too
        pass
    except BaseException:  # no room for what came out, or it can not be sent
        traceback.print_exc()
    finally:
        os._exit(status)


def _wait(children):
    """Until all have ended well."""
    while children:
        status = os.waitstatus_to_exitcode(os.waitpid(children[-1], 0)[1])
        children.pop()
        if status:
            raise RuntimeError(f"a process of this job ended with status {status}")


def _read(file):
    with suppress(EOFError):
        while True:
            yield pickle.load(file)
