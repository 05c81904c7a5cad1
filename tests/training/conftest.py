"""One thread: small tensors gain nothing from more, and a busy machine makes several threads wait for each other."""

from collections.abc import Callable

import pytest
import torch

from lfstereo.training.stages import LOSSES, select_parts


@pytest.fixture(autouse=True, scope="session")
def one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture
def five_steps() -> Callable[[torch.nn.Module, str, object], tuple[list[float], set[str]]]:
    """Five steps on one batch: the losses, and the parts whose weights changed."""

    def take(network: torch.nn.Module, stage: str, batch: object) -> tuple[list[float], set[str]]:
        before = {name: value.clone() for name, value in network.named_parameters()}
        optimiser = torch.optim.AdamW(select_parts(network, stage), 1e-3)
        losses = []
        for _ in range(5):
            optimiser.zero_grad()
            loss = LOSSES[stage](network, batch)
            loss.backward()
            optimiser.step()
            losses.append(float(loss.detach()))
        after = network.named_parameters()
        return losses, {name.split(".")[0] for name, value in after if not torch.equal(value, before[name])}

    return take
