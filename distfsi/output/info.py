"""What an output directory holds, told from its files: `distfsi info`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from distfsi.errors import InputError
from distfsi.output.fields import field_names, series
from distfsi.output.history import read_history
from distfsi.output.journal import read_journal
from distfsi.output.manifest import earlier_results
from distfsi.output.progress import format_duration, format_time
from distfsi.output.restart import files_of
from distfsi.output.scales import format_bytes

WORDS = {
    "running": "still running, or ended without a word (killed, power cut)",
    "done": "done",
    "stopped": "stopped early",
    "diverged": "ended by an invalid state",
    "failed": "ended by an error",
}


def describe(directory: Path) -> str:
    """Title, how the run ended, steps and time, fields, gauges, restart files and sizes, as text.

    Raises InputError when the directory holds no results.
    """
    journal, history = read_journal(directory), directory / "history.csv"
    lines = [*_journal(journal), *_progress(history, journal)]
    for kind in ("cells", "particles"):
        lines += _fields(directory, kind)
    lines += [*_gauges(directory), *_restarts(directory), *_earlier(directory)]
    if not lines:
        raise InputError([f"{directory}: no results of a run here"])
    total = sum(path.stat().st_size for path in directory.rglob("*") if path.is_file())
    lines.append(("size", f"{format_bytes(total)} in all"))
    title = journal.get("title") or directory.name
    return "\n".join([title, *(f"  {name:<11}{text}" for name, text in lines)])


Line = tuple[str, str]


def _journal(journal: Mapping[str, Any]) -> Iterator[Line]:
    if not journal:
        return
    took = f" after {format_duration(journal['seconds'])}" if "seconds" in journal else ""
    yield "ended", WORDS[journal["status"]] + took
    if "message" in journal:
        yield from (("" if n else "because", line) for n, line in enumerate(journal["message"].splitlines()))
    if total := sum(journal.get("seconds by part", {}).values()):
        parts = sorted(journal["seconds by part"].items(), key=lambda part: -part[1])
        yield "time in", ", ".join(f"{part} {100.0 * seconds / total:.0f} %" for part, seconds in parts)
    where = f"{journal['ranks']} rank(s) of {journal['threads per rank']} thread(s)"
    yield "run", f"{journal['started']}, distfsi {journal['distfsi']}, {where}"


def _progress(history: Path, journal: Mapping[str, Any]) -> Iterator[Line]:
    if not history.exists():
        return
    rows = read_history(history)
    if len(rows["step"]):
        end = f" of {format_time(float(journal['end time [s]']))}" if journal else ""
        reached = f"{format_time(float(rows['time [s]'][-1]))}{end} after {rows['step'][-1]:,.0f} steps"
        yield "reached", f"{reached}, by the {len(rows['step'])} rows of {history.name}"


def _fields(directory: Path, kind: str) -> Iterator[Line]:
    files = series(directory, kind)
    if files:
        (first, path), (last, _) = files[0], files[-1]
        size = format_bytes(sum(path.stat().st_size for _, path in files))
        yield kind, f"{len(files)} time(s) from {format_time(first)} to {format_time(last)}, {size}"
        yield "", ", ".join(field_names(path))


def _gauges(directory: Path) -> Iterator[Line]:
    source = directory / "gauges"
    names = sorted({path.stem for path in source.glob("*.csv")} | {p.parent.name for p in source.glob("*/*.series")})
    if names:
        yield "gauges", ", ".join(names)


def _earlier(directory: Path) -> Iterator[Line]:
    for path, size in earlier_results(directory):
        yield "earlier", f"{path.name}: results that were set aside, {format_bytes(size)}; removed by distfsi clean"


def _restarts(directory: Path) -> Iterator[Line]:
    for step, path in files_of(directory):
        yield "restart", f"{path.name}: after {step:,} steps, {format_bytes(path.stat().st_size)}"
