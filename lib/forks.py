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
from contextlib import suppress

FEW = 48  # items of some milliseconds that are not worth a process
WIDTH = 4  # bytes of an item's number in the queue
MOST = 8192  # numbers in the queue, which holds 64 kB

_allowed = 1


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
    queue = _queue(range(0, len(items), step))
    files, children = [tempfile.TemporaryFile() for _ in range(workers - 1)], []
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
    for k in range(len(items)):
        if not done[k][0]:
            function(items[k])  # raises it again, from where it stands in the code
            raise done[k][1]
    return [done[k][1] for k in range(len(items))]


def _queue(numbers):
    """The end of a pipe that numbers are read from, each by one process, to the end."""
    out, into = os.pipe()
    os.write(into, b"".join(number.to_bytes(WIDTH, sys.byteorder) for number in numbers))
    os.close(into)
    return out


def _worked(queue, function, items, step):
    """(number, (is_done, result or exception)) of the items that this process got hold of."""
    while number := os.read(queue, WIDTH):
        first = int.from_bytes(number, sys.byteorder)
        for k in range(first, min(first + step, len(items))):
            try:
                yield k, (True, function(items[k]))
            except Exception as error:
                yield k, (False, error)


def _forked(queue, function, items, step, file):
    """The number of a child that works and writes what came out into `file`."""
    parent = os.getpid()
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
    except BaseException:  # told by the status: what stopped this one stops the parent as well, or it is out of room
        pass
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
