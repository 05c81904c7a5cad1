"""Exit codes and one-line errors of the program."""

from __future__ import annotations

import types

import pytest

from lfstereo.cli import main as cli
from lfstereo.errors import ConfigError, GridFitError, LfstereoError, MissingExtraError


@pytest.fixture
def failing(monkeypatch: pytest.MonkeyPatch) -> dict[str, BaseException | None]:
    """Make ``lfstereo info`` raise what the test puts in."""
    raised: dict[str, BaseException | None] = {"error": None}

    def run(arguments: object) -> int:
        if raised["error"] is not None:
            raise raised["error"]
        return 0

    module = types.SimpleNamespace(configure=lambda parser: None, run=run)
    monkeypatch.setattr(cli.importlib, "import_module", lambda name: module)
    return raised


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (None, 0),
        (LfstereoError("x"), 1),
        (ConfigError("a.toml: wrong"), 3),
        (MissingExtraError("install it"), 3),
        (GridFitError("no grid"), 4),
        (KeyboardInterrupt(), 130),
    ],
)
def test_exit_codes(
    failing: dict[str, BaseException | None], capsys: pytest.CaptureFixture[str], error: BaseException | None, code: int
) -> None:
    failing["error"] = error
    assert cli.main(["info"]) == code
    err = capsys.readouterr().err
    assert err.count("\n") == (error is not None)
    assert "Traceback" not in err


def test_a_bug_shows_its_traceback(
    failing: dict[str, BaseException | None], capsys: pytest.CaptureFixture[str]
) -> None:
    failing["error"] = ZeroDivisionError("oops")
    assert cli.main(["info"]) == 1
    assert "Traceback" in (err := capsys.readouterr().err)
    assert "this is a bug" in err


@pytest.mark.parametrize("words", [[], ["nosuch"], ["--nosuch"]])
def test_usage_errors_are_2(words: list[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(words)
    assert caught.value.code == 2


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_every_command_has_help(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main([name, "--help"])
    assert caught.value.code == 0
    assert name in capsys.readouterr().out
