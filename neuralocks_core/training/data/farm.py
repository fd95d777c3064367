# SPDX-License-Identifier: Apache-2.0
"""A folder that fills with rollouts while training goes on."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import read_npz, replace_npz
from neuralocks_core.materials import RANGES
from neuralocks_core.models.network_sizes import K
from neuralocks_core.training.data.rollouts import FINEST, Rollout, RolloutMaker, TrainingScene


class RolloutFarm:
    """Processes that fill a folder with rollouts while training goes on; a context manager.

    Args:
        scene: what to draw rollouts from.
        folder: where the files go, one per rollout, numbered.
        count: number of rollouts to make.
        processes: number of processes.
    """

    def __init__(self, scene: TrainingScene, folder: Path, count: int, processes: int = 1):
        self.folder, self.count = Path(folder), count
        self.folder.mkdir(parents=True, exist_ok=True)
        context = multiprocessing.get_context("spawn")
        self._told, self._tell = context.Pipe(duplex=False)  # both ends kept: an end closes with its last owner
        self._scene, self._lines = scene, [context.Pipe() for _ in range(processes)]
        work = [(line, self.folder, range(i, count, processes), self._tell) for i, (_, line) in enumerate(self._lines)]
        self._processes = [context.Process(target=_work, args=each, daemon=True) for each in work]

    def __enter__(self) -> RolloutFarm:
        try:
            with _one_thread_each(), _without_interrupts():
                for process in self._processes:
                    process.start()
            self._hand_over()
        except BaseException:  # if one cannot start, the others are stopped
            self.__exit__()
            raise
        return self

    def _hand_over(self) -> None:
        """Give each process the scene once it asks. As an argument it would go into a pipe that is too small for it, and Python waits
        for good, deaf to Ctrl-C, for a process that ends before it reads that.
        """
        for process, (line, theirs) in zip(self._processes, self._lines):
            theirs.close()
            if line in wait([line, process.sentinel]):
                with suppress(EOFError, OSError):  # it ended; `failed` tells
                    line.recv()
                    line.send(self._scene)

    def __exit__(self, *_) -> None:
        for process in self._processes:
            if process.pid is None:
                continue
            process.terminate()
            process.join()
        for leftover in self.folder.glob("*.tmp"):
            leftover.unlink(missing_ok=True)

    def files(self, first: int | None = None) -> list[Path]:
        """The rollouts that exist by now, in order: all, or those numbered below `first`."""
        if first is None:
            return sorted(self.folder.glob("*.npz"))
        return [path for path in (_path(self.folder, index) for index in range(first)) if path.exists()]

    @property
    def alive(self) -> bool:
        """Whether any process is still running."""
        return any(process.is_alive() for process in self._processes)

    def failed(self) -> bool:
        """Whether a process ended with an error."""
        return any(process.exitcode not in (None, 0) for process in self._processes)

    def failure(self) -> NeuralocksError:
        """Why it failed; what it has made so far is still there."""
        if self._told.poll():
            why = self._told.recv()
        elif any((process.exitcode or 0) < 0 for process in self._processes):
            why = "training: the solver's process was killed; free some memory"
        else:
            why = "training: the solver's process ended early; fix what it reports above"
        return NeuralocksError(f"{why}, and go on with --resume")


def check_guarded() -> None:
    """Refuse to train while a process of a farm imports the script that trains.

    Raises:
        NeuralocksError: this is such a process.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):  # multiprocessing's own check reads it, too
        raise NeuralocksError(
            "training: its processes import the script that calls it, and would train again; "
            'call it under if __name__ == "__main__":'
        )


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes started in this block compute in one thread: the trainer has the other cores."""
    kept = {name: os.environ.get(name) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    os.environ.update({name: "1" for name in kept})
    try:
        yield
    finally:
        for name, value in kept.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Ctrl-C, which a terminal sends to all processes, takes effect at the end of this block; processes started in it ignore it,
    and print no traceback.
    """
    came = []
    try:
        before = signal.signal(signal.SIGINT, lambda *_: came.append(True))
    except ValueError:  # not the main thread, and only that may set signal handlers
        yield
        return
    held = None
    if hasattr(signal, "pthread_sigmask"):  # not on Windows
        resource_tracker.ensure_running()  # if the first process starts it, it lets signals through
        held = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # handlers are not inherited, the mask is
    try:
        yield
    finally:
        if held is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, held)
        signal.signal(signal.SIGINT, before)
    if came:
        signal.raise_signal(signal.SIGINT)


def save(path: Path, rollout: Rollout) -> None:
    """Write a rollout atomically under its final name.

    Raises:
        NeuralocksError: the file system refuses.
    """
    replace_npz(path, vars(rollout))


def load(path: Path, scene: TrainingScene | None = None) -> Rollout:
    """Read what `save` wrote; it must belong to `scene`, if given.

    Raises:
        NeuralocksError: it is damaged, as after a full disk or a power cut, or is not such a rollout.
    """
    try:
        values = read_npz(path)
        if "step" not in values:  # all have the finest step, and larger displacements are clipped
            if np.abs(values["moved"]).max(initial=0) >= np.iinfo(np.int16).max:
                raise ValueError("moved")
            values["step"] = FINEST
        rollout = Rollout(
            **{
                **values,
                "groom": int(values["groom"]),
                "first": int(values["first"]),
                "step": float(values["step"]),
                "residual": float(values["residual"]),
            }
        )
        _check(rollout, scene)
        return rollout
    except (ValueError, KeyError, TypeError):
        raise NeuralocksError(
            f"{path}: this simulation cannot be read; delete it, and go on with --resume: it is made again"
        ) from None


def _check(rollout: Rollout, scene: TrainingScene | None) -> None:
    """Refuse arrays that do not fit each other or the scene: training would fail halfway through.

    Raises:
        ValueError: they do not fit.
    """
    frames, strands = len(rollout.vectors), len(rollout.strands)
    shapes = {
        "strands": (strands,),
        "rest": (strands, K, 3),
        "vectors": (frames, len(rollout.bind)),
        "bind": (len(rollout.bind),),
        "moved": (frames, strands, K, 3),
        "planes": (frames, strands, K, 4),
        "materials": (strands, len(RANGES)),
    }
    for name, shape in shapes.items():
        array = getattr(rollout, name)
        if array.shape != shape or array.dtype.kind != ("i" if name in ("strands", "moved") else "f"):
            raise ValueError(name)
    if not (strands and 0 <= rollout.first < frames and frames > 1 and rollout.strands.min() >= 0):
        raise ValueError("first, strands")
    if not 0 < rollout.step < np.inf:
        raise ValueError("step")
    if scene and not (
        0 <= rollout.groom < len(scene.grooms)
        and rollout.strands.max() < len(scene.grooms[rollout.groom].rest)
        and len(rollout.bind) == scene.spec.size
    ):
        raise ValueError("scene")


def _path(folder: Path, index: int) -> Path:
    return folder / f"{index:06d}.npz"


def _work(line: Connection, folder: Path, indices: range, tell: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is only blocked until now, on Windows not even that
    parent = multiprocessing.parent_process()
    try:
        line.send(None)
        scene = line.recv()
    except (EOFError, OSError):  # the trainer has ended
        return
    try:
        maker = RolloutMaker(scene)
        for index in indices:
            path = _path(folder, index)
            if not path.exists():
                save(path, maker.make(index))
            if parent is not None and not parent.is_alive():
                return
    except NeuralocksError as error:
        tell.send(str(error))
        raise SystemExit(1) from None
    except MemoryError:
        tell.send("training: the solver does not have enough memory; free some")
        raise SystemExit(1) from None
