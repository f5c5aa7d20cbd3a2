"""``DepthPeeler``: the layers of a picture from front to back."""

from collections.abc import Iterable
from types import TracebackType
from typing import Self

from tilestamp.models.errors import TilestampError
from tilestamp.simulator.nvdiffrast.arrays import Array, Faults, are_mended
from tilestamp.simulator.nvdiffrast.draw import Clip
from tilestamp.simulator.nvdiffrast.rasterize import PEELERS, Batch, Depths, Raster


class DepthPeeler:
    """Draw layer after layer: each pixel of a layer shows what lies next behind that of the layer before.

    ``with DepthPeeler(pos, tri, resolution) as peeler: rast, rast_db = peeler.rasterize_next_layer()``

    Parameters
    ----------
    pos, tri, resolution, ranges, grad_db, clip
        As ``rasterize`` takes them.
    faults : {"mended", "kept"}
        Mended, a peeler has a state of its own: any number may be at work, and ``rasterize`` draws meanwhile. Kept,
        there is one state, as in a context of the original: a second peeler is refused, and ``rasterize`` returns,
        not raises, an exception.

    Notes
    -----
    Depths are compared in fixed point; of several triangles at one depth the last shows, the others in no layer.
    """

    def __init__(
        self,
        pos: Array,
        tri: Array,
        resolution: Iterable[int],
        ranges: Array | None = None,
        grad_db: bool = True,
        *,
        clip: Clip = "2025",
        faults: Faults = "mended",
    ) -> None:
        self._batch: Batch | None = Batch(pos, tri, resolution, ranges, grad_db, clip)
        self._shared = not are_mended(faults)
        self._inside = False
        self._depths: Depths | None = None

    def __enter__(self) -> Self:
        if self._batch is None:
            raise TilestampError("this depth peeling has ended: make a new DepthPeeler")
        if self._shared and PEELERS:
            raise TilestampError("one depth peeler is at work already; with faults='mended' there may be several")
        if self._shared:
            PEELERS.append(self)
        self._inside = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._batch, self._depths, self._inside = None, None, False
        PEELERS[:] = [peeler for peeler in PEELERS if peeler is not self]

    def rasterize_next_layer(self) -> Raster:
        """Rasterize the nearest layer, then at each call the next one behind; zeros where there is none left.

        Returns
        -------
        rast, rast_db
            As ``rasterize`` returns them.

        Raises
        ------
        TilestampError
            Outside of the ``with`` block.
        """
        if self._batch is None or not self._inside:
            raise TilestampError("rasterize_next_layer is called inside the peeler's with block")
        raster, self._depths = self._batch.layer(self._depths)
        return raster
