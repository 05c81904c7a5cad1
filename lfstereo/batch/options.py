"""Options of a batch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from lfstereo.errors import ConfigError
from lfstereo.options import option

PairBy = Literal["auto", "folder", "name", "time"]


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """How captures are paired and who converts them."""

    pair_by: PairBy = option("auto", "what makes two captures a pair; auto takes the way that leaves fewest alone")
    pattern: str = option("", "file names of a pair, such as {scene}_{side}.LFR; empty: the usual ones")
    clock_offset_s: float | None = option(None, "right camera's clock minus the left one's; unset: estimated", "s")
    clock_tolerance_s: float = option(2.0, "largest difference in time within a pair, the offset taken off", "s")
    workers: int = option(0, "local worker processes; 0 = as many as cores and free memory allow")
    network_workers: int = option(-1, "local processes for the network alone; -1 = one where there is CUDA, else none")
    scheduler: str = option("", "address of a Dask scheduler, such as tcp://host:8786, that does the work instead")
    shard: str = option("", "part i of n of the pairs, such as 2/8, for job arrays")
    retries: int = option(2, "new attempts for a pair whose worker was lost")
    time_limit_s: float = option(900.0, "time for one pair, after which its worker is stopped", "s")
    truth: str = option("", "folder beside the left captures with a true disparity.pfm to report errors against")

    def __post_init__(self) -> None:
        _check("clock_tolerance_s", self.clock_tolerance_s, self.clock_tolerance_s > 0, "more than 0")
        _check("workers", self.workers, self.workers >= 0, "0 or more")
        _check("network_workers", self.network_workers, self.network_workers >= -1, "-1 or more")
        _check("retries", self.retries, self.retries >= 0, "0 or more")
        _check("time_limit_s", self.time_limit_s, self.time_limit_s > 0, "more than 0")
        self.shard_of()

    def shard_of(self) -> tuple[int, int]:
        """Return (i, n), 1-based; (1, 1) where there are no shards.

        Raises
        ------
        ConfigError
            If it is not written i/n with 1 <= i <= n.
        """
        if not self.shard:
            return 1, 1
        part, _, whole = self.shard.partition("/")
        good = part.isdecimal() and whole.isdecimal() and 1 <= int(part) <= int(whole)
        _check("shard", repr(self.shard), good, "i/n with 1 <= i <= n, such as 2/8")
        return int(part), int(whole)


def _check(name: str, value: object, good: bool, expected: str) -> None:
    if not good:
        raise ConfigError(f"{name} = {value}, expected {expected}; correct the option")
