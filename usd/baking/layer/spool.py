# SPDX-License-Identifier: Apache-2.0
"""Finished frames, and the layer made of them, on disk beside the output: a killed bake resumes where it stopped."""

import hashlib
import json
import os
import re
import shutil
import stat
import uuid
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import cannot_write, make_way, put_in_place, reach_disk, remove_empty
from neuralocks_core.lock_file import FolderLock

from ...border.stopping import deferred
from .frame_file import has_size, is_whole, read_rows, write_frame
from .save_log import SaveLog, spent_frames

_FRAME = r"\d+_-?0x[01](\.[0-9a-f]+)?p[+-]\d+\.frame"
_SPARE = rf"{_FRAME[: -len('frame')]}part"
_LAYER, _TEXT = (rf"[0-9a-f]{{32}}\.part\.{ending}" for ending in ("usdc", "usda"))
_LOG, _INPUTS = "saves", "inputs"
_KEPT, _STRAY = rf"{_FRAME}|{_LAYER}|{_LOG}|{_INPUTS}", rf"{_SPARE}|{_TEXT}|{_LOG}\.part"


class Spool:
    """A folder `.NAME.baking` next to the output, valid for one set of inputs.

    Attributes:
        layer_path: where the output is assembled.
        log: of that file, once `go_on` was called.

    Args:
        out: the output file.
        fingerprint: digest of everything the samples depend on; a spool with another one is deleted.

    Raises:
        NeuralocksError: the folder cannot be written, the output is write-protected, or another bake is writing it.
    """

    def __init__(self, out: Path, fingerprint: str):
        self.out = out
        self._sure: set[Path] = set()  # frames written or checked by this process
        self._spares: list[Path] = []
        self.folder = _folder(out)
        try:
            self._made = make_way(out)
        except OSError as error:
            raise cannot_write(out, error) from None
        self._lock = FolderLock(
            self.folder, out, "another bake is writing it; wait for that one or choose another name"
        )
        try:
            self._forget_others(fingerprint.encode())
        except OSError as error:
            self.close()
            raise cannot_write(out, error) from None
        # USD keeps layers by name for as long as anybody holds them, so each time the name is a new one.
        self.layer_path = self.folder / f"{uuid.uuid4().hex}.part.usdc"

    def _forget_others(self, fingerprint: bytes) -> None:
        mark = self.folder / _INPUTS
        if not _is_file(mark) or mark.read_bytes() != fingerprint:
            for old in self._named(_KEPT):
                _remove(old)
            mark.write_bytes(fingerprint)
        # A folder or a link under a name of ours cannot be replaced by a file, or leads elsewhere.
        for stray in [*self._named(_STRAY), *(path for path in self._named(_KEPT) if not _is_file(path))]:
            _remove(stray)

    def _named(self, pattern: str) -> list[Path]:
        """What is in the folder under our names: anything else that a user put there stays."""
        return [path for path in self.folder.iterdir() if re.fullmatch(pattern, path.name)]

    def go_on(self, plan: str, spent: Sequence[int]) -> int:
        """Take over the layer that a bake of the same plan left, if there is one, as `layer_path`.

        Args:
            plan, spent: see `SaveLog`.

        Returns:
            How many samples are in it; 0 means that a new one must be made.
        """
        self.log = SaveLog(self.folder / _LOG, plan, spent)
        left, puts = self._named(_LAYER), 0
        try:
            if len(left) == 1 and (puts := self.log.restore(left[0])):
                os.replace(left[0], self.layer_path)
                return puts
        except OSError:
            pass
        self.drop_layers()
        return 0

    def drop_layers(self) -> None:
        """Remove left-over layers, to make a new one.

        Raises:
            CannotWrite: the file system refuses.
        """
        try:
            for layer in self._named(_LAYER):
                _remove(layer)
        except OSError as error:
            raise cannot_write(self.out, error) from None

    def size(self) -> int:
        """Bytes of all data that is there to resume from."""
        return sum(path.stat().st_size for path in self._named(_KEPT))

    def holds(self, batch: int, time_code: float, points: int) -> bool:
        """Whether all points (points, 3) of a frame are there, as they were written."""
        path = self._path(batch, time_code)
        if path not in self._sure and has_size(path, points) and is_whole(path):
            self._sure.add(path)
        return path in self._sure

    def read(self, batch: int, time_code: float, first: int, into: np.ndarray) -> None:
        """Fill `into` (n, 3) float32 with points of a frame that is there, from the `first` on.

        Raises:
            NeuralocksError: they cannot be read.
        """
        path = self._path(batch, time_code)
        try:
            read_rows(path, first, into)
        except (OSError, ValueError) as error:
            raise NeuralocksError(f"{path}: cannot be read ({error}); bake again") from None

    def write(self, batch: int, time_code: float, array: np.ndarray) -> None:
        """Store the points (P, 3) of a finished frame."""
        path = self._path(batch, time_code)
        try:
            write_frame(path, array, self._spares.pop() if self._spares else None)
        except OSError as error:
            raise cannot_write(self.out, error) from None
        self._sure.add(path)

    def forget(self, batch: int, time_code: float) -> None:
        """Release a frame that is no longer needed, if it is there. A later one reuses its space on the disk, which is much faster
        than allocating space for each.
        """
        path = self._path(batch, time_code)
        self._sure.discard(path)
        with suppress(OSError):
            spare = path.with_suffix(".part")
            os.replace(path, spare)
            self._spares.append(spare)

    def keep_only(self, frames: Iterable[tuple[int, float]]) -> None:
        """Remove all frames except those of these batches and time codes: a bake of other frames may have left some."""
        kept = {self._path(batch, code) for batch, code in frames}
        for path in self._named(_FRAME):
            if path not in kept:
                self._sure.discard(path)
                _remove(path)

    def finish(self) -> None:
        """Move the assembled layer to its final name and remove the rest; this is not stopped halfway."""
        with deferred():
            try:
                reach_disk(self.layer_path)
                put_in_place(self.layer_path, self.out)
            except OSError as error:
                raise cannot_write(self.out, error) from None
            self.discard()

    def close(self) -> None:
        """Leave the finished frames for a later bake to resume from; if there are none, leave no folder."""
        if kept(self.out):
            for spare in self._spares:
                with suppress(OSError):
                    spare.unlink()
            self._lock.release()
        else:
            self.discard()

    def discard(self) -> None:
        """Remove our files, then this folder and those made for an output that was not written, unless something else is in them.
        Once the lock is released, what is in the folder may be another bake's, and stays.
        """
        if not self._lock.held:
            return
        # Before the lock is released: otherwise a process that takes it would lose its own files.
        for path in list(self.folder.glob("*")):
            if re.fullmatch(rf"{_KEPT}|{_STRAY}", path.name):
                with suppress(OSError):
                    _remove(path)
        self._lock.release()
        remove_empty(self._made)

    def _path(self, batch: int, time_code: float) -> Path:
        return self.folder / f"{batch}_{float(time_code).hex()}.frame"


def kept(out: Path) -> int:
    """How many finished frames of an interrupted bake are beside its output, counted for each batch of grooms."""
    folder = _folder(out)
    try:
        frames, layers = (sum(1 for _ in folder.glob(f"*.{ending}")) for ending in ("frame", "part.usdc"))
    except OSError:  # a name too long for a folder
        return 0
    return frames + (spent_frames(folder / _LOG) if layers else 0)


def _folder(out: Path) -> Path:
    return out.parent / f".{out.name}.baking"


def _is_file(path: Path) -> bool:
    """Whether it is a file, and not a link to one."""
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except OSError:
        return False


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def fingerprint(files, values: dict) -> str:
    """Digest of files (by name, size and time of change) and plain values."""
    facts = []
    for file in sorted(map(str, files)):
        try:
            found = os.stat(file)
            facts.append([file, found.st_size, found.st_mtime_ns])
        except OSError:
            facts.append([file, -1, -1])
    return hashlib.sha256(json.dumps([facts, values], sort_keys=True).encode()).hexdigest()


def unsaved_digest(layers) -> str:
    """Digest of what layers (Sdf.Layer) hold that is in no file."""
    return hashlib.sha256("".join(sorted(layer.ExportToString() for layer in layers)).encode()).hexdigest()


def program_files() -> list[Path]:
    """The program's own files: a bake does not resume from frames of another version."""
    import neuralocks_core

    folders = Path(__file__).parents[2], Path(neuralocks_core.__file__).parent
    return [file for folder in folders for file in folder.rglob("*.py")]
