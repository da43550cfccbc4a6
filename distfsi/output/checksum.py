"""A checksum behind the bytes of a file, by which each of them is known to be the one that was written.

HDF5 does not see it, and a damaged file must not be shown to HDF5, which may take the process down. It is
the SHA-256 of those of the file's segments, which ranks read side by side.
"""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

from distfsi.output.interfaces import Communicator

MARK = b"distfsi check  1"
BYTES = len(MARK) + 8 + sha256().digest_size
SEGMENT = 2**22  # bytes


def add_checksum(path: Path, communicator: Communicator) -> None:
    """Put a checksum behind a complete file. Collective. Raises OSError on all ranks."""
    size, failure = communicator.broadcast(_size(path) if communicator.rank == 0 else None)
    if not failure:
        digest, failure = _digest(path, size, communicator)
    if not failure and communicator.rank == 0:
        try:
            with path.open("ab") as file:
                file.write(MARK + size.to_bytes(8, "little") + digest)
        except OSError as error:
            failure = _words(error)
    failure = communicator.broadcast(failure)
    if failure:
        raise OSError(failure)


def damage(path: Path, communicator: Communicator | None = None) -> str:
    """What is wrong with a file with a checksum; empty if nothing is. Collective; None: this process alone."""
    size, mark, failure = 0, b"", ""
    try:
        size = path.stat().st_size - BYTES
        with path.open("rb") as file:
            file.seek(max(0, size))
            mark = file.read()
    except (OSError, ValueError) as error:
        failure = _words(error)
    if communicator:
        size, mark, failure = communicator.broadcast((size, mark, failure))
    if failure:
        return failure
    if not mark.startswith(MARK) or size < 0:
        return "it has no checksum at its end: it was cut short, changed, or written by an earlier version"
    if mark[len(MARK) :][:8] != size.to_bytes(8, "little"):
        return "it has another length than it was written with"
    whole, failure = _digest(path, size, communicator)
    return failure or ("" if mark.endswith(whole) else "its bytes are not those that were written")


def _size(path: Path) -> tuple[int, str]:
    """Bytes of a file, and why they are not known."""
    try:
        return path.stat().st_size, ""
    except OSError as error:
        return 0, _words(error)


def _words(error: OSError | ValueError) -> str:
    return getattr(error, "strerror", None) or str(error)


def _digest(path: Path, size: int, communicator: Communicator | None) -> tuple[bytes, str]:
    """Collective. The SHA-256 of those of all segments of the first `size` bytes, and why there is none."""
    rank, ranks = (communicator.rank, communicator.size) if communicator else (0, 1)
    own, failure = {}, ""
    try:
        with path.open("rb") as file:
            for start in range(rank * SEGMENT, size, ranks * SEGMENT):
                file.seek(start)
                own[start] = sha256(file.read(min(SEGMENT, size - start))).digest()
    except OSError as error:
        failure = _words(error)
    parts = communicator.allgather((own, failure)) if communicator else [(own, failure)]
    digests = {start: digest for part, _ in parts for start, digest in part.items()}
    failures = [failure for _, failure in parts if failure]
    return sha256(b"".join(digest for _, digest in sorted(digests.items()))).digest(), "".join(failures[:1])
