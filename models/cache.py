"""What a cache holds of the buffers of a frame, launch by launch: by buffer and not by line; written back at the end.

A launch goes through all its buffers at once. What it leaves is shared among them by footprint, where they do not all
fit; buffers of earlier launches leave first, the oldest before the others, and of the launch's own what it does not
touch. So while a launch runs, what it brings in pushes out first what lies there for longer than the buffers that it
finds, and then these: of them each byte as likely as another, so that the later it is wanted, the less likely it is
still there.
"""

from collections.abc import Mapping
from dataclasses import dataclass

STEPS = 60  # of what is lost to what was brought in since more was lost: each ends nearer by a half or more


@dataclass
class _Resident:
    """Bytes of one buffer in the cache, how many of them DRAM does not have yet, and the last launch that used it."""

    size: float
    dirty: float
    launch: int


class Cache:
    """Cache of a number of bytes, empty at first.

    Parameters
    ----------
    capacity : float
        Bytes, not 0.
    dirty : float
        Bytes that it holds at most of what DRAM does not have yet.
    """

    def __init__(self, capacity: float, dirty: float) -> None:
        self.capacity = capacity
        self._dirty = dirty
        self._buffers: dict[str, _Resident] = {}  # oldest first
        self._launches = 0

    def run(self, footprints: Mapping[str, float], written: Mapping[str, float]) -> tuple[dict[str, float], float]:
        """Let a launch use buffers; return bytes of each that it found, and bytes that were written back.

        Parameters
        ----------
        footprints : mapping
            Bytes of each buffer that it touches.
        written : mapping
            Bytes that it writes, of those.
        """
        self._launches += 1
        found = self._found(footprints)
        shares = self._shares(footprints)
        back = sum(
            self._use(name, size, shares, found[name], written.get(name, 0.0)) for name, size in footprints.items()
        )
        return found, back + self._evict() + self._clean()

    def _found(self, footprints: Mapping[str, float]) -> dict[str, float]:
        """Bytes of each buffer that are still there when the launch comes to them."""
        held = {name: min(size, self._size(name)) for name, size in footprints.items()}
        room = {name: self._older(name) for name, size in held.items() if size}
        touched, found, brought = sum(footprints.values()), held, -1.0
        for _ in range(STEPS):
            before, brought = brought, touched - sum(found.values())
            if brought <= before + 1.0:
                break
            found = {name: size * self._kept(brought, room[name]) if size else 0.0 for name, size in held.items()}
        return found

    def _shares(self, footprints: Mapping[str, float]) -> tuple[float, float]:
        """Shares that stay of what a launch touches, and of what else is there of the same buffers."""
        touched = sum(footprints.values())
        others = sum(max(0.0, self._size(name) - size) for name, size in footprints.items())
        room = max(0.0, self.capacity - touched)
        return min(1.0, self.capacity / max(1.0, touched)), min(1.0, room / others) if others else 0.0

    def _kept(self, brought: float, room: float) -> float:
        """Share of a buffer that is still there when it is wanted; what comes in takes older ones' room first."""
        beyond = max(0.0, brought - room)
        return max(0.0, 1.0 - beyond / brought * beyond / (2.0 * self.capacity)) if beyond else 1.0

    def _size(self, name: str) -> float:
        entry = self._buffers.get(name)
        return entry.size if entry else 0.0

    def _older(self, name: str) -> float:
        """Bytes that go before those of a buffer: nothing, or what no launch used since."""
        launch = self._buffers[name].launch
        return self.capacity - sum(entry.size for entry in self._buffers.values() if entry.launch >= launch)

    def _use(self, name: str, footprint: float, shares: tuple[float, float], found: float, written: float) -> float:
        """Leave a buffer's share in the cache; return what was written back of it meanwhile."""
        entry = self._buffers.pop(name, _Resident(0.0, 0.0, 0))
        lost = 1.0 - found / min(entry.size, footprint) if entry.size and footprint else 0.0
        dirty = entry.dirty * (1.0 - lost)
        share, stays = shares
        size = footprint * share + max(0.0, entry.size - footprint) * stays
        left = min(size, max(dirty, written * share))
        self._buffers[name] = _Resident(size, left, self._launches)
        return entry.dirty - dirty + max(0.0, max(dirty, written) - left)

    def _evict(self) -> float:
        """Push out the oldest bytes, of all buffers of a launch alike; return what had to be written."""
        excess, back = sum(entry.size for entry in self._buffers.values()) - self.capacity, 0.0
        for launch in sorted({entry.launch for entry in self._buffers.values()}):
            if excess <= 0.0:
                break
            old = {name: entry for name, entry in self._buffers.items() if entry.launch == launch}
            size = sum(entry.size for entry in old.values())
            left = max(0.0, 1.0 - excess / size) if size else 0.0
            excess -= size
            back += sum(entry.dirty for entry in old.values()) * (1.0 - left)
            kept = {name: _Resident(e.size * left, e.dirty * left, launch) for name, e in old.items()} if left else {}
            self._buffers = kept | {name: entry for name, entry in self._buffers.items() if name not in old}
        return back

    def _clean(self) -> float:
        """Write back the oldest bytes that DRAM does not have until no more are left than may; return how many."""
        excess = sum(entry.dirty for entry in self._buffers.values()) - self._dirty
        back = max(0.0, excess)
        for entry in self._buffers.values():
            out = min(entry.dirty, max(0.0, excess))
            entry.dirty -= out
            excess -= out
        return back
