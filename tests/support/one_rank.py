"""A communicator of one rank that writes files."""

from pathlib import Path


class OneRank:
    """A single rank that writes files like the real one, and dies on demand after writing some of the arrays."""

    rank = 0

    def __init__(self, dies: bool = False):
        self.dies = dies

    def broadcast(self, value):
        return value

    def allgather(self, value):
        return [value]

    def write_at(self, path, offsets, arrays):
        with Path(path).open("r+b") as file:
            for offset, array in list(zip(offsets, arrays, strict=True))[: 1 if self.dies else None]:
                file.seek(offset)
                file.write(array.tobytes())
        if self.dies:
            raise KeyboardInterrupt
