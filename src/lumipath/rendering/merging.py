"""Adding films that were rendered apart."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

from attrs import evolve

from ..errors import CheckpointError, LumipathWarning
from .checkpoint import Checkpoint, SampleRange
from .film import Film


def merge(paths: Sequence[str | Path]) -> Checkpoint:
    """The sum of the checkpoints in some files: one picture from renders with other seeds or other samples.

    Raises:
        CheckpointError: a file cannot be read, two are not of the same picture, or two hold the same samples.
    """
    if not paths:
        raise CheckpointError("there is nothing to merge: name at least one checkpoint")
    first = Checkpoint.load(paths[0])
    held = [(paths[0], part) for part in first.ranges]
    film, seconds, devices = first.film, first.seconds, [first.device]
    left_out: set[str] = set()
    # One after the other, so that two films are in memory, not all of them.
    for path in paths[1:]:
        other = Checkpoint.load(path)
        other.require_same(first.identity, path, str(paths[0]))
        held += [(path, part) for part in other.ranges]
        _require_disjoint(held)
        kept = [name for name in film.layer_names if name in other.film.layer_names]
        left_out |= {*film.layer_names, *other.film.layer_names} - {*kept}
        _add(film, other.film, path)
        seconds += other.seconds
        devices += [] if other.device in devices else [other.device]
    if left_out:
        message = (
            f"not all of {', '.join(map(str, paths))} have the layers {', '.join(sorted(left_out))}: the sum has none"
        )
        warnings.warn(message, LumipathWarning, stacklevel=2)
    ranges = joined([part for _, part in held])
    return evolve(first, film=film, ranges=ranges, seconds=seconds, device=", ".join(devices))


def joined(ranges: Sequence[SampleRange]) -> tuple[SampleRange, ...]:
    """The ranges in order; those of a seed that follow on one another become one, where no pixel lacks any between."""
    result: list[SampleRange] = []
    for part in sorted((part for part in ranges if part.stop > part.first), key=lambda part: (part.seed, part.first)):
        last = result[-1] if result else None
        if last and last.seed == part.seed and last.stop == part.first and last.whole:
            result[-1] = evolve(part, first=last.first)
        else:
            result.append(part)
    return tuple(result)


def _require_disjoint(held: Sequence[tuple[str | Path, SampleRange]]) -> None:
    for (path, a), (other, b) in combinations(held, 2):
        if a.seed == b.seed and max(a.first, b.first) < min(a.stop, b.stop):
            both = SampleRange(a.seed, max(a.first, b.first), min(a.stop, b.stop), True)
            raise CheckpointError(
                f"{path} and {other} both hold {both}, which would count twice; render one of them anew "
                "with another --seed or --first-sample"
            )


def _add(film: Film, other: Film, path: str | Path) -> None:
    try:
        film.add(other)
    except ValueError as error:
        raise CheckpointError(f"{path}: {error}") from None
