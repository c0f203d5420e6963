"""How much main memory a job will take, told before anything large is made; and the limit on it.

A job goes through stages, and in each of them three parties hold arrays: NumPy on the host, JAX on
its device, and the renderer. What one of them frees it keeps for itself, and the next stage of
another cannot have it. So a job's peak is, party by party, the most that any stage asks of it, all
three together. A device with memory of its own is counted as if it shared the host's.

    seen = 4096**2 * Memory(host=76, device=29)
    check([Stage("casting the eye buffer", seen, ("size",))], limit_of(max_memory_mb=2000))
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields

from asmjax import machine
from asmjax.errors import UseError, require


class MemoryShort(UseError):
    """A job would take more memory than it may."""


SHARE = 0.8
"""Part of the memory that is free which may be taken where nobody says how much."""

MEGABYTE = 2**20


@dataclass(frozen=True)
class Memory:
    """Bytes of arrays: NumPy's on the host, JAX's on its device, the renderer's."""

    host: float = 0
    device: float = 0
    renderer: float = 0

    def __add__(self, other: "Memory") -> "Memory":
        return Memory(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))

    def __rmul__(self, count: float) -> "Memory":
        return Memory(*(count * part for part in astuple(self)))

    @property
    def bytes(self) -> int:
        """All together."""
        return int(sum(astuple(self)))


PARTIES = tuple(field.name for field in fields(Memory))


@dataclass(frozen=True)
class Stage:
    """A while of a job.

    Attributes:
        name: what is done then.
        memory: all that is there then.
        options: of the command line; smaller ones make it smaller.
    """

    name: str
    memory: Memory
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Limit:
    """How much main memory the process may hold.

    Attributes:
        bytes: in all; None where there is no limit.
        held: bytes that it held when the limit was set: programs and scene.
        reason: who says so.
    """

    bytes: int | None
    held: int
    reason: str

    @property
    def room(self) -> int | None:
        """Bytes that are left of it; None where there is no limit."""
        return None if self.bytes is None else max(0, self.bytes - self.held)


@dataclass(frozen=True)
class Forecast:
    """What was compared with a limit.

    Attributes:
        peak: what the job adds to what was held.
    """

    limit: Limit
    peak: Memory

    def record(self) -> dict:
        """As a report has it."""
        return {
            "held_bytes": self.limit.held,
            "estimate_bytes": self.peak.bytes,
            "limit_bytes": self.limit.bytes,
        }


def limit_of(max_memory_mb: float | None = None) -> Limit:
    """The limit that is asked for, in MB of 2^20 bytes; else what the process holds and `SHARE` of
    what it may still get; none where that cannot be told."""
    held = machine.process_bytes()
    if max_memory_mb is not None:
        return Limit(int(max_memory_mb * MEGABYTE), held, "`max_memory_mb`")
    free = machine.free_memory_bytes()
    if free is None:
        return Limit(None, held, "not known")
    reason = f"these and {100 * SHARE:.0f} % of the {_mb(free)} MB that are free"
    return Limit(held + int(SHARE * free), held, reason)


def peak_of(stages: Sequence[Stage]) -> Memory:
    """The most that each party holds in any stage."""
    return Memory(**{party: _need(_greediest(stages, party), party) for party in PARTIES})


def check(stages: Sequence[Stage], limit: Limit) -> Forecast:
    """What a job of these stages will take.

    Raises:
        MemoryShort: with what was held that is above the limit; with the numbers.
    """
    require(len(stages) > 0, "a job without stages takes no memory; name one at least.")
    peak = peak_of(stages)
    if limit.bytes is None or limit.held + peak.bytes <= limit.bytes:
        return Forecast(limit, peak)
    largest = [(_greediest(stages, party), party) for party in PARTIES]
    largest.sort(key=lambda pair: -_need(*pair))
    named = [f"{_mb(_need(*pair))} MB of {pair[1]} memory for {pair[0].name}" for pair in largest]
    options = dict.fromkeys(f"`{name}`" for stage, _ in largest for name in stage.options)
    smaller = f"lower {' or '.join(options)}, or raise" if options else "raise"
    raise MemoryShort(
        f"this would take about {_mb(peak.bytes)} MB ({'; '.join(named)}) besides the "
        f"{_mb(limit.held)} MB that the process holds; allowed are {_mb(limit.bytes)} MB in all "
        f"({limit.reason}): {smaller} `max_memory_mb`."
    )


def _greediest(stages: Sequence[Stage], party: str) -> Stage:
    return max(stages, key=lambda stage: _need(stage, party))


def _need(stage: Stage, party: str) -> float:
    return getattr(stage.memory, party)


def _mb(count: float) -> str:
    return f"{count / MEGABYTE:,.0f}"
