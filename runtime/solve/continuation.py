"""Another name of the driver of `solve.homotopy`."""

from softehl.runtime.solve.homotopy import Continuation

__all__ = ["Continuation"]
