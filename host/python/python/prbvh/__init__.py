"""Optimises bounding volume hierarchies by parallel reinsertion, on any GPU and any CPU."""

from typing import NamedTuple

import numpy as np

from . import _prbvh
from ._prbvh import PrbvhError, __version__

__all__ = ["NODE", "Optimized", "PrbvhError", "__version__", "optimize", "optimize_boxes"]

NODE = np.dtype([("min", np.float32, 3), ("first", np.uint32), ("max", np.float32, 3), ("count", np.uint32)])
"""A node, 32 bytes. Where ``count`` is 0, nodes ``first`` and ``first + 1`` are its children; else it is a leaf of the primitives
``order[first : first + count]``. The root is node 0, and children come after their parents."""


class Optimized(NamedTuple):
    """A tree and how it came about."""

    nodes: np.ndarray
    """``NODE``, shape (m,), m = 2n - 1 with one primitive per leaf."""
    order: np.ndarray
    """Primitive ids, leaf by leaf: uint32, shape (n,)."""
    report: dict
    """``initial_cost`` and ``cost`` (SAH; 3 for a node, 2 for a primitive), ``stop`` (why it ended), ``iterations``, ``device``,
    ``build_s``, ``optimize_s``, ``max_depth``, ``leaves``, ``max_links`` (what the depth was bound to; None: nothing was changed),
    and ``rows``: a dict of arrays, one element an iteration."""


def _optimized(made):
    nodes, order, report = made
    return Optimized(nodes.view(NODE), order, report)


def optimize(
    vertices,
    triangles=None,
    *,
    device="auto",
    threads=0,
    initial="lbvh",
    optimizer="prbvh",
    max_iterations=None,
    max_time=None,
    target_cost=None,
    max_leaf=1,
    max_depth=63,
    progress=None,
):
    """Build a tree over triangles and optimise it.

    Parameters
    ----------
    vertices : float32 array, shape (v, 3), C-contiguous
        Read without a copy, as is ``triangles``.
    triangles : uint32 array, shape (n, 3), C-contiguous, optional
        Vertices of each triangle. Without it, triangle k has vertices 3k, 3k + 1 and 3k + 2.
    device : str
        ``auto`` (a GPU if there is one), ``cpu``, ``vulkan`` or ``vulkan:N``.
    threads : int
        Threads of the CPU; 0: one per core.
    initial : str
        The tree that is optimised, as the command has it: ``lbvh``, ``ploc``, ``atrbvh``, ``trbvh``, ``hploc``, ``sah-sweep``, ``sah-binned``,
        ``sbvh``, ``agglomerative``, ``aac``, ``kmeans``, ``insertion``, ``online``, ``hunt`` or ``phr``; some with parameters, such as ``aac:fast``
        or ``kmeans:k=16,p=5,i=5``.
    optimizer : str
        What makes it better: ``prbvh``, ``rbvh``, ``rotations`` or ``none``.
    max_iterations, max_time, target_cost
        What ends the run early: iterations, seconds, a SAH cost. None: only that nothing more is to be gained.
    max_leaf : int
        Most primitives of a leaf; more than one where that costs less.
    max_depth : int or None
        Most links from the root to a leaf.
    progress : callable, optional
        Is called with a dict (``iteration``, ``seconds``, ``cost``) in each iteration. If it returns something true, the run ends with the
        best tree so far.

    Returns
    -------
    Optimized

    Raises
    ------
    TypeError, ValueError
        Where an array or an option is not what it must be; the text says which dtype or shape.
    PrbvhError
        If there is no such device, or it fails.
    KeyboardInterrupt
        Soon after Ctrl+C: other threads run while it works, and it looks for signals in each iteration.
    """
    options = (device, threads, initial, max_iterations, max_time, target_cost, max_leaf, max_depth, progress, optimizer)
    return _optimized(_prbvh.triangles(vertices, triangles, options))


def optimize_boxes(
    boxes,
    *,
    device="auto",
    threads=0,
    initial="lbvh",
    optimizer="prbvh",
    max_iterations=None,
    max_time=None,
    target_cost=None,
    max_leaf=1,
    max_depth=63,
    progress=None,
):
    """Build a tree over boxes and optimise it.

    Parameters
    ----------
    boxes : float32 array, shape (n, 2, 3), C-contiguous
        Smallest and largest corner of each.

    The rest is that of :func:`optimize`.
    """
    options = (device, threads, initial, max_iterations, max_time, target_cost, max_leaf, max_depth, progress, optimizer)
    return _optimized(_prbvh.boxes(boxes, options))
