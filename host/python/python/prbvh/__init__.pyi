from typing import Any, Callable, Dict, NamedTuple, Optional, TypedDict

import numpy as np
import numpy.typing as npt

__version__: str

NODE: np.dtype[np.void]

class PrbvhError(RuntimeError): ...

class Progress(TypedDict):
    iteration: int
    seconds: float
    cost: float

class Report(TypedDict):
    initial_cost: float
    cost: float
    stop: str
    iterations: int
    device: str
    build_s: float
    optimize_s: float
    max_depth: int
    leaves: int
    max_links: Optional[int]
    rows: Dict[str, npt.NDArray[Any]]

class Optimized(NamedTuple):
    nodes: npt.NDArray[np.void]
    order: npt.NDArray[np.uint32]
    report: Report

def optimize(
    vertices: npt.NDArray[np.float32],
    triangles: Optional[npt.NDArray[np.uint32]] = None,
    *,
    device: str = "auto",
    threads: int = 0,
    initial: str = "lbvh",
    optimizer: str = "prbvh",
    max_iterations: Optional[int] = None,
    max_time: Optional[float] = None,
    target_cost: Optional[float] = None,
    max_leaf: int = 1,
    max_depth: Optional[int] = 63,
    progress: Optional[Callable[[Progress], object]] = None,
) -> Optimized: ...
def optimize_boxes(
    boxes: npt.NDArray[np.float32],
    *,
    device: str = "auto",
    threads: int = 0,
    initial: str = "lbvh",
    optimizer: str = "prbvh",
    max_iterations: Optional[int] = None,
    max_time: Optional[float] = None,
    target_cost: Optional[float] = None,
    max_leaf: int = 1,
    max_depth: Optional[int] = 63,
    progress: Optional[Callable[[Progress], object]] = None,
) -> Optimized: ...
