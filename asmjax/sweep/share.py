"""How much main memory the process of a trial may hold: what was asked for, or its share."""

from dataclasses import dataclass

from asmjax import machine
from asmjax.memory import MEGABYTE, SHARE, Limit


@dataclass(frozen=True)
class Share:
    """Main memory of one process.

    Attributes:
        bytes: that it may hold in all.
        reason: who says so.
    """

    bytes: int
    reason: str

    def limit(self) -> Limit:
        """As what a trial will take is held to it, in the process that it is for."""
        return Limit(self.bytes, machine.process_bytes(), self.reason)


def share_of(workers: int, max_memory_mb: float | None) -> Share | None:
    """What the process of a trial may hold; None where nobody says, or where it cannot be told.

    Args:
        workers: processes beside each other, for which there is the free memory of this machine; 0
            where there is none to share.
        max_memory_mb: what was asked for, MB of 2^20 bytes.
    """
    if max_memory_mb is not None:
        return Share(int(max_memory_mb * MEGABYTE), "--max-memory")
    free = machine.free_memory_bytes()
    if workers == 0 or free is None:
        return None
    reason = (
        f"a share of {100 * SHARE:.0f} % of the free memory for each of {workers} workers; "
        "fewer --workers have more each"
    )
    return Share(int(SHARE * free / workers), reason)
