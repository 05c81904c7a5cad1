"""Cards and weights: strict, verified, one-line errors."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from lfstereo.errors import AssetError, OutputError
from lfstereo.network.bdff_net import Architecture, BdffNet
from lfstereo.network.card import Metric, ModelCard, Training, read_card, write_card
from lfstereo.network.estimate import slice_limits
from lfstereo.network.shipped import CARD, DEFAULT_MODEL, WEIGHTS, find_model
from lfstereo.network.weights import load_model, save_model

SMALL = Architecture(focus_width=4, edof_width=4, tail_width=4, stereo_width=16)
HALF_PRECISION = 1e-3  # relative, of a float16 weight


def card(architecture: Architecture = SMALL) -> ModelCard:
    training = Training("rendered", 'a "small" processor', 1.5, "2026-01-02", ("stereo: 3 steps", "edof: 4 steps"))
    metric = Metric("mae", 2.5, "px", "held out", "python -m lfstereo.training.evaluate x")
    return ModelCard("tiny", 1, "BSD-3-Clause", "", ("one, two", "three"), ("none",), architecture, training, (metric,))


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.manual_seed(0)
    folder = tmp_path_factory.mktemp("models") / "tiny-v1"
    save_model(folder, BdffNet(SMALL), card())
    return folder


@pytest.fixture
def copied(model: Path, tmp_path: Path) -> Path:
    for path in model.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def test_card_survives_a_round_trip(tmp_path: Path) -> None:
    (tmp_path / CARD).write_text(write_card(card()))
    assert read_card(tmp_path / CARD) == card()


def test_weights_survive_a_round_trip_through_float16(model: Path) -> None:
    torch.manual_seed(0)
    wanted = BdffNet(SMALL).state_dict()
    network, found = load_model(model)
    assert found == dataclasses.replace(card(), sha256=found.sha256)
    assert not network.training
    for name, value in network.state_dict().items():
        assert value.dtype == wanted[name].dtype
        np.testing.assert_allclose(value, wanted[name], rtol=HALF_PRECISION, atol=1e-4)


def test_published_folder_is_not_overwritten(model: Path) -> None:
    with pytest.raises(OutputError, match="exists already"):
        save_model(model, BdffNet(SMALL), card())


def test_weights_beyond_float16_are_refused(tmp_path: Path) -> None:
    network = BdffNet(SMALL)
    torch.nn.init.constant_(network.edof.body[0].norm.weight, 1e6)
    with pytest.raises(AssetError, match="not finite as float16"):
        save_model(tmp_path / "big-v1", network, card())


def test_missing_weights(copied: Path) -> None:
    (copied / WEIGHTS).unlink()
    with pytest.raises(AssetError, match="no such file"):
        load_model(copied)


def test_missing_card(copied: Path) -> None:
    (copied / CARD).unlink()
    with pytest.raises(AssetError, match="cannot be read"):
        load_model(copied)


def test_damaged_weights_are_refused_before_parsing(copied: Path) -> None:
    payload = bytearray((copied / WEIGHTS).read_bytes())
    payload[len(payload) // 2] ^= 1
    (copied / WEIGHTS).write_bytes(payload)
    with pytest.raises(AssetError, match="sha256"):
        load_model(copied)


def test_weights_that_are_no_safetensors(copied: Path) -> None:
    import hashlib

    (copied / WEIGHTS).write_bytes(b"not weights")
    rewrite(copied, lambda c: dataclasses.replace(c, sha256=hashlib.sha256(b"not weights").hexdigest()))
    with pytest.raises(AssetError, match="not a safetensors file"):
        load_model(copied)


def test_card_of_another_width(copied: Path) -> None:
    rewrite(copied, lambda c: dataclasses.replace(c, architecture=dataclasses.replace(SMALL, edof_width=8)))
    with pytest.raises(AssetError, match=r"weight edof\..* has shape"):
        load_model(copied)


def test_missing_weight_in_the_file(copied: Path) -> None:
    import hashlib

    state = load_file(copied / WEIGHTS)
    state.pop("edof.body.0.conv.weight")
    save_file(state, copied / WEIGHTS)
    digest = hashlib.sha256((copied / WEIGHTS).read_bytes()).hexdigest()
    rewrite(copied, lambda c: dataclasses.replace(c, sha256=digest))
    with pytest.raises(AssetError, match=r"edof\.body\.0\.conv\.weight' is missing"):
        load_model(copied)


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("licence =", "license =", "'licence' is missing"),
        ("version = 1", "version = 1\ncolour = 2", "'colour' is unknown"),
        ("edof_width = 4", "edof_width = 'x'", "does not fit"),
        ("edof_width = 4", "edof_width = 1000000000", "edof_width = 1000000000, expected 1 to 256"),
        ("edof_width = 4", "edof_width = 0", "edof_width = 0, expected 1 to 256"),
        ("version = 1", "version = = 1", "not valid TOML"),
    ],
)
def test_bad_cards(copied: Path, before: str, after: str, message: str) -> None:
    text = (copied / CARD).read_text()
    assert before in text
    (copied / CARD).write_text(text.replace(before, after))
    with pytest.raises(AssetError, match=message):
        load_model(copied)


def test_unknown_model() -> None:
    with pytest.raises(AssetError, match="neither a shipped model"):
        find_model("nothing-v9")


@pytest.mark.parametrize("name", [DEFAULT_MODEL, "bdffnet-r16-v1", "bdffnet-paper-r16-v1"])
def test_shipped_models_load_and_are_small(name: str) -> None:
    folder = find_model(name)
    network, found = load_model(folder)
    assert f"{found.name}-v{found.version}" == name
    assert found.licence == "BSD-3-Clause"
    assert slice_limits(network) == ((5, 64) if name == DEFAULT_MODEL else (16, 16))
    assert all(path.stat().st_size < 16e6 for path in folder.iterdir())


def rewrite(folder: Path, change) -> None:  # type: ignore[no-untyped-def]
    (folder / CARD).write_text(write_card(change(read_card(folder / CARD))))
