"""Fuzz one parser for long: ``python -m tests.fuzz NAME [-runs=N] [libFuzzer's options] [FOLDER]``.

With atheris (``pip install -e '.[fuzz]'``, Linux) the run is guided by coverage; FOLDER keeps what reached new code.
With ``--plain N [SEED]`` N inputs are drawn as the tests draw them. A finding ends the run and is printed.
"""

from __future__ import annotations

import sys
import warnings

INSTRUMENTED = ["lfstereo.container", "lfstereo.lenslet", "lfstereo.lightfield", "lfstereo.depth", "lfstereo.options"]


def main(words: list[str]) -> int:
    """Run one target."""
    if not words or words[0].startswith("-"):
        print(__doc__, file=sys.stderr)
        return 2
    name, rest = words[0], words[1:]
    return _plain(name, rest[1:]) if rest[:1] == ["--plain"] else _guided(name, rest)


def _plain(name: str, words: list[str]) -> int:
    from tests.fuzz.mutate import damaged
    from tests.fuzz.targets import TARGETS

    warnings.simplefilter("ignore")  # a damaged picture may make a decoder warn; what counts is what lfstereo does
    target = TARGETS[name]
    count, seed = int(words[0]), int(words[1]) if len(words) > 1 else 0
    for done, data in enumerate(damaged(target.seeds(), count, seed)):
        try:
            target.read(data)
        except BaseException:
            print(f"{name}: input {done} of seed {seed}: {data[:4000]!r}", file=sys.stderr)
            raise
    print(f"{name}: {count} executions, no finding")
    return 0


def _guided(name: str, words: list[str]) -> int:
    import atheris

    with atheris.instrument_imports(include=[*INSTRUMENTED, "tests.fuzz.targets"], enable_loader_override=False):
        from tests.fuzz.targets import FOLDER, TARGETS
    from tests.fuzz.mutate import damaged_once

    warnings.simplefilter("ignore")
    target = TARGETS[name]
    seeds = target.seeds()

    def mutate(data: bytes, max_size: int, seed: int) -> bytes:
        """Two of three times damage as the tests do, which keeps texts whole; else the engine's own."""
        return damaged_once(data, seeds, seed)[:max_size] if seed % 3 else bytes(atheris.Mutate(data, max_size))

    corpus = FOLDER / "corpus"
    corpus.mkdir()
    for number, data in enumerate(seeds):
        (corpus / f"{number:02d}").write_bytes(data)
    options = ["-timeout=20", "-rss_limit_mb=2048", "-max_len=16384", "-print_final_stats=1"]
    folders = [word for word in words if not word.startswith("-")]
    words = [sys.argv[0], *options, *(word for word in words if word.startswith("-")), *folders, str(corpus)]
    atheris.Setup(words, target.read, custom_mutator=mutate)
    atheris.Fuzz()
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
