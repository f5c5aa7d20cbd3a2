"""The SIMT shape of a machine: what counting depends on. Another shape means executing again; the rest re-prices."""

from enum import IntEnum
from typing import NamedTuple


class Coalescing(IntEnum):
    """Rule that turns the addresses of one memory instruction into transactions (CUDA 4.2 guide, appendix F)."""

    HALF_WARP_SEGMENTS = 1  # compute capability 1.2, 1.3: half-warps, 128-byte segments that shrink to 64 and 32 bytes
    WARP_LINES = 2  # 2.x, 3.x: 128-byte lines through L1
    WARP_SECTORS = 3  # 5.x and later: 32-byte sectors of 128-byte lines


class AtomicMerge(IntEnum):
    """Which lanes of one atomic instruction travel in one request."""

    NONE = 0  # every lane by itself (GT200)
    SECTOR = 1  # distinct words of one 32-byte sector; lanes at the same address stay apart (H200, measured)


class Simt(NamedTuple):
    """Integers only, so that Numba kernels take it as it is."""

    warp: int = 32
    coalescing: int = Coalescing.WARP_SECTORS
    banks: int = 32
    bank_lanes: int = 32  # lanes that access shared memory together: a half-warp (16) on 1.x
    atomic_merge: int = AtomicMerge.SECTOR
    sms: int = 132  # persistent kernels launch this many blocks
    bank_bytes: int = 4  # that a bank of shared memory serves a pass: 8 on 3.x
    bank_mode_bytes: int = 4  # consecutive words of this size lie in consecutive banks: 4 or 8 on 3.x

    @property
    def votes(self) -> bool:
        """Whether the lanes of warps of 32 can vote: from compute capability 2.0 on."""
        return self.warp == 32 and self.coalescing != Coalescing.HALF_WARP_SEGMENTS

    def differences(self, other: "Simt", *, persistent: bool) -> list[str]:
        """Say what is counted otherwise on another machine; the number of SMs only for ``persistent`` kernels."""
        pairs = zip(self._fields, self, other, strict=True)
        return [
            f"{name} {ours} and {theirs}"
            for name, ours, theirs in pairs
            if ours != theirs and (persistent or name != "sms")
        ]
