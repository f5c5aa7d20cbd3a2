"""Lines in L2 that were stored with gaps: before one goes back to DRAM, the rest of it is fetched.

Records with padding leave them. Such lines may fill a part of L2 only; those beyond are filled up and written back by
the launch that stores them, the others by later launches, as what these bring in pushes them out. That DRAM turns from
writing to reading and back for each few of them is what they cost (``l2_gap_lines_per_clock``).
"""

from tilestamp.models.launch import LINE_BYTES


class GapLines:
    """Those that a frame's launches leave behind.

    Parameters
    ----------
    kept_bytes : float
        That L2 keeps of all buffers.
    gap_bytes : float
        That such lines may take of it.
    """

    def __init__(self, kept_bytes: float, gap_bytes: float) -> None:
        self._kept_bytes, self._gap_bytes = kept_bytes, gap_bytes
        self._stayed = self._left = 0.0

    def run(self, brought: float, stored: float) -> float:
        """Let a launch bring in some bytes, and store others with gaps; return lines that were filled up.

        A store with gaps goes over what is left of the one before it: in each frame the same buffer.
        """
        out = min(self._left, self._stayed * brought / self._kept_bytes) if self._left else 0.0
        self._left -= out
        if stored:
            self._stayed = self._left = min(stored, self._gap_bytes)
            out += stored - self._stayed
        return out / LINE_BYTES
