"""The scene file into which the blocks of a run are joined."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import IO, Any

from scenegen.formats.blocks import Block
from scenegen.formats.files import begin_writing
from scenegen.formats.registry import HEADER_LAST, TEXT, format_of
from scenegen.formats.shards import Shards
from scenegen.processes.pool import run_pieces
from scenegen.processes.reserve import Reserve
from scenegen.scene.data import SceneFile

PART = 8192  # scenes whose text a process makes at a time
MANY = 4 * PART  # scenes from which on other processes make their text: fewer take less time than a process to start


class JoinedFile:
    """`joining` is called with every block that goes into the file; `stored` makes of it what the file holds. With
    several workers the text of many `scenes` is made by as many processes."""

    def __init__(
        self,
        shards: Shards,
        path: Path,
        labels: Sequence[str],
        joining: Callable[[Block], None] | None,
        stored: Callable[[Block], Block] | None,
        workers: int,
        reserve: Reserve | None,
        scenes: int,
    ) -> None:
        self._shards, self._labels = shards, labels
        self._format, self._ending = format_of(path), path.suffix.lower()
        self._joining, self._stored = joining, stored
        self._workers, self._reserve, self._scenes = workers, reserve, scenes

    @property
    def can_be_ahead(self) -> bool:
        """Whether it can be packed while scenes are drawn, by a core that one worker would not use."""
        return self._workers > 1 and self._ending in HEADER_LAST

    def write(
        self, header: SceneFile, blocks: Iterable[Block], *, final: Callable[[], SceneFile] | None = None
    ) -> None:
        """`final` gives the header after the last block, if the format can wait for it. Raises OutputError."""
        with ExitStack() as ending:
            options: dict[str, Any] = {} if final is None else {"final": final}
            if self._workers > 1 and self._ending in TEXT and self._scenes >= MANY:

                def each(job: Callable[[Block], bytes], blocks: Iterable[Block]) -> Generator[bytes, None, None]:
                    made = run_pieces(job, _parts(blocks), self._workers, self._reserve)
                    ending.callback(made.close)
                    return made

                options["each"] = each

            def write(sink: IO[bytes]) -> None:
                self._format.write(sink, header, self._labels, self._seen(blocks, sink), **options)

            self._shards.join(write)

    def _seen(self, blocks: Iterable[Block], sink: IO[bytes]) -> Iterator[Block]:
        for block in blocks:
            if self._joining is not None:
                self._joining(block)
            yield block if self._stored is None else self._stored(block)
            begin_writing(sink)


def _parts(blocks: Iterable[Block]) -> Iterator[Block]:
    for block in blocks:
        for start in range(0, block.count, PART):
            yield block.part(start, start + PART)
