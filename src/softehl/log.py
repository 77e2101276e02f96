"""The package's logger, `logging.getLogger("softehl")`: silent until a script configures it.

DEBUG has Newton's iterations, INFO load and time steps and builds of kernels that take more than
two seconds and the compiler where it is that of a package, WARNING warnings of states and files.
"""

from __future__ import annotations

import logging
import warnings

LOG = logging.getLogger("softehl")
LOG.addHandler(logging.NullHandler())


def warn(message: str, category: type[Warning] = UserWarning, *, stacklevel: int = 1) -> None:
    """Warn as `warnings.warn` does, and log the message."""
    LOG.warning(message)
    warnings.warn(message, category, stacklevel=stacklevel + 1)
