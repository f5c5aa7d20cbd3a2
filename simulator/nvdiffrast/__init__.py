"""nvdiffrast's forward interface on NumPy arrays, without a GPU: its results to the bit (0.4.0, as on an H200).

>>> import tilestamp.simulator.nvdiffrast as dr  # doctest: +SKIP
>>> rast, rast_db = dr.rasterize(pos, tri, resolution=(1024, 1024))  # doctest: +SKIP
>>> color, _ = dr.interpolate(attributes, rast, tri)  # doctest: +SKIP

Every function takes NumPy arrays, and anything on the CPU with ``__array__`` or ``__dlpack__``. Contexts fall away.
"""

from tilestamp.simulator.nvdiffrast.antialias import antialias
from tilestamp.simulator.nvdiffrast.depth_peeler import DepthPeeler
from tilestamp.simulator.nvdiffrast.interpolate import interpolate
from tilestamp.simulator.nvdiffrast.mipmap import texture_construct_mip
from tilestamp.simulator.nvdiffrast.rasterize import rasterize
from tilestamp.simulator.nvdiffrast.texture import texture
from tilestamp.simulator.nvdiffrast.topology import antialias_construct_topology_hash

__all__ = [
    "DepthPeeler",
    "antialias",
    "antialias_construct_topology_hash",
    "interpolate",
    "rasterize",
    "texture",
    "texture_construct_mip",
]
