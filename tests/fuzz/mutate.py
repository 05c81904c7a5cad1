"""Damage to bytes, drawn from a seed: what the short run of the tests does without a fuzzing engine."""

from __future__ import annotations

import random
from collections.abc import Iterator

_LENGTHS = (0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF)
_TEXTS = (b"1e999", b"-1", b"9" * 400, b"NaN", b"null", b"[]", b"{}", b'"\\ud800"', b'"\\u0000"', b"true", b"0", b"../")


def damaged(seeds: list[bytes], count: int, seed: int) -> Iterator[bytes]:
    """Yield ``count`` inputs: the seeds themselves first, then each with one to four damages."""
    rng = random.Random(seed)
    yield from seeds[:count]
    for _ in range(count - len(seeds)):
        data = bytearray(rng.choice(seeds))
        for _ in range(rng.choice((1, 1, 2, 4))):
            data = _once(data, seeds, rng)
        yield bytes(data)


def damaged_once(data: bytes, seeds: list[bytes], seed: int) -> bytes:
    """Return one input with one or two damages."""
    rng = random.Random(seed)
    changed = _once(bytearray(data), seeds, rng)
    return bytes(_once(changed, seeds, rng) if rng.random() < 0.3 else changed)


def _once(data: bytearray, seeds: list[bytes], rng: random.Random) -> bytearray:
    at = rng.randrange(len(data) + 1)
    how = rng.randrange(8)
    if how == 0:
        return data[:at]
    if how == 1 and data:
        data[at % len(data)] ^= 1 << rng.randrange(8)
    elif how == 2:
        del data[at : at + rng.randrange(1, 20)]
    elif how == 3:
        data[at:at] = data[at : at + rng.randrange(1, 200)]
    elif how == 4:
        number = rng.choice(_LENGTHS)
        size = rng.choice((1, 2, 4, 8))
        data[at : at + size] = (number & (1 << 8 * size) - 1).to_bytes(size, rng.choice(("big", "little")))
    elif how == 5:
        other = rng.choice(seeds)
        data[at:] = other[rng.randrange(len(other) + 1) :]
    else:
        return _value(data, rng)
    return data


def _value(data: bytearray, rng: random.Random) -> bytearray:
    """Replace one value of a text: what stands behind a colon or an equals sign."""
    marks = [place for place, byte in enumerate(data) if byte in b":="]
    if marks:
        start = rng.choice(marks) + 1
        end = next((n for n in range(start, min(start + 60, len(data))) if data[n] in b",}]\n"), start)
        data[start:end] = b" " + rng.choice(_TEXTS)
    return data
