"""One process that has numpy and the stages loaded, and a fork of it for each job of a bake.

Starting an interpreter and importing numpy and a stage costs a job 0.15 to 0.25 CPU s, more than what most jobs of a
small scene do; a fork costs 0.01 s.  The Snakefile calls `start` when a run begins, or before, to have the scene read;
jobs reach the process through `stages/__main__.py`, which runs the stage by itself where there is no such process (on
other machines, by hand).  A stage is loaded when its first job comes, before the fork, with its compiled loops; what
two jobs found to load besides, such as OpenImageIO, is loaded before the next of any kind.  No module starts a thread
when it is loaded, which a fork would lose.

A request is a message of 8 bytes, the length of what follows, and texts with a zero byte between them: working folder,
number of arguments, stage, arguments, NAME=VALUE of the environment; with it come the file descriptors of standard
input, output and error.  The answer is the exit status as text.
"""

import atexit
import functools
import gc
import importlib
import os
import selectors
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import traceback
from collections import Counter
from contextlib import suppress
from typing import NamedTuple

VARIABLE = "BAKE_WARM"  # of the environment: where jobs find the address
_HEAD = 8
ENOUGH = 2  # jobs that had to load a module: another one will
MOST_TOLD = 1 << 15  # bytes of names of modules: half of what a pipe holds


@functools.cache
def start():
    """Start the process, once, and put its address into the environment; it ends with this one.

    Nothing is started, and jobs run by themselves, where the system has no process descriptors (Linux 5.3 and later has
    them) or no place for a socket: its path may hold 107 bytes.
    """
    os.environ.pop(VARIABLE, None)
    if not hasattr(os, "pidfd_open"):
        return
    try:
        folder = tempfile.mkdtemp(prefix="bake-")  # open to this user alone
    except OSError:
        return
    address = os.path.join(folder, "jobs")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        try:
            listener.bind(address)
        except OSError:
            shutil.rmtree(folder, ignore_errors=True)
            return
        listener.listen(128)
        command = [sys.executable, "-P", "-m", "lib.warm_start", str(listener.fileno())]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=[listener.fileno()])
    os.environ[VARIABLE] = address

    def end():
        process.stdin.close()
        process.wait()
        shutil.rmtree(folder, ignore_errors=True)

    atexit.register(end)


class Request(NamedTuple):
    """A stage to run, with the arguments, working folder and environment of who asked."""

    folder: str
    stage: str
    arguments: list
    environment: dict


class Child(NamedTuple):
    """A job: its process and the descriptor of that, and the end of a pipe that tells what it had to load."""

    pid: int
    descriptor: int
    loaded: int


class Jobs:
    """Forks children for requests that come on the socket `listener`, and answers with their exit status."""

    def __init__(self, listener):
        self._listener, self._events = listener, selectors.DefaultSelector()
        self._children = {}  # {connection: Child}
        self._learned = Counter()  # {module: jobs that had to load it}

    def serve(self, lifeline):
        """Until the file `lifeline` is at its end; then the children are ended too."""
        self._events.register(self._listener, selectors.EVENT_READ)
        self._events.register(lifeline, selectors.EVENT_READ)
        while True:
            for key, _ in self._events.select():
                if key.fileobj is lifeline:
                    for child in self._children.values():
                        os.kill(child.pid, signal.SIGTERM)
                    return
                if key.fileobj is self._listener:
                    self._begin(self._listener.accept()[0])
                elif key.fileobj is not key.data:
                    self._end(key.data)
                elif key.data in self._children:  # who asked was stopped
                    os.kill(self._children[key.data].pid, signal.SIGTERM)
                    self._events.unregister(key.data)

    def _begin(self, connection):
        try:
            request, streams = _received(connection)
            _load(f"stages.{request.stage}", *(name for name, jobs in self._learned.items() if jobs >= ENOUGH))
            child = _forked(request, streams, [self._listener, connection, *self._children])
        except (OSError, ValueError):  # who asked has gone, or there is no room for a process: nothing is answered
            connection.close()
            return
        self._children[connection] = child
        for event in (connection, child.descriptor):
            self._events.register(event, selectors.EVENT_READ, connection)

    def _end(self, connection):
        child = self._children.pop(connection)
        status = os.waitstatus_to_exitcode(os.waitpid(child.pid, 0)[1])
        with open(child.loaded) as file:
            self._learned.update(set(file.read().split()))
        with suppress(KeyError):
            self._events.unregister(connection)
        self._events.unregister(child.descriptor)
        os.close(child.descriptor)
        with suppress(OSError):
            connection.sendall(str(status if status >= 0 else 128 - status).encode())  # as a shell has it
        connection.close()


def _received(connection):
    """(Request, [3 file descriptors])."""
    data, streams, _, _ = socket.recv_fds(connection, 1 << 16, 3)
    while len(data) < _HEAD or len(data) < _HEAD + int.from_bytes(data[:_HEAD], sys.byteorder):
        more = connection.recv(1 << 20)
        if not more:
            raise ValueError("a request ended early")
        data += more
    folder, n, stage, *rest = (os.fsdecode(word) for word in data[_HEAD:].split(b"\0"))
    return Request(folder, stage, rest[: int(n)], dict(word.split("=", 1) for word in rest[int(n) :])), streams


def _load(*modules):
    """Import what can be imported: the job will say what is wrong with the rest."""
    from lib import compiled  # here: the reader of the Snakefile needs it not

    for name in modules:
        with suppress(Exception):
            importlib.import_module(name)
    with suppress(Exception):
        compiled.load_kept()


def _forked(request, streams, sockets):
    """A Child that runs the request, with these streams and without these sockets."""
    gc.collect()
    gc.freeze()  # what is loaded stays shared: the children's collections leave it alone
    loaded, tells = os.pipe()
    pid = os.fork()
    if not pid:
        _run(request, streams, sockets, tells)
    for descriptor in (*streams, tells):
        os.close(descriptor)
    return Child(pid, os.pidfd_open(pid), loaded)


def _run(request, streams, sockets, tells):
    """Become the job; does not return."""
    status, known = 1, set(sys.modules)
    try:
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
            os.close(stream)
        for one in sockets:
            one.close()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        gc.enable()
        os.chdir(request.folder)
        os.environ.clear()
        os.environ.update(request.environment)
        name = f"stages.{request.stage}"
        sys.argv = [name, *request.arguments]
        status = importlib.import_module(name).main(request.arguments)
    except SystemExit as end:  # from argparse
        status = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
            os.write(tells, " ".join(sorted(set(sys.modules) - known)).encode()[:MOST_TOLD])
        os._exit(status)


if __name__ == "__main__":
    gc.disable()  # modules make no garbage: looking for it takes a tenth of the time to load them
    import numpy.ma  # noqa: F401  what numpy itself loads when a job first sorts

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the jobs hear it, and Snakemake, which ends this process
    Jobs(socket.socket(fileno=int(sys.argv[1]))).serve(sys.stdin)
    os._exit(0)  # what is frozen is never collected, which libraries would complain of on the way out
