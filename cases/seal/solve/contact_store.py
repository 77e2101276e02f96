"""Contact states that runs leave for each other: the contact stage knows neither speed nor film.

A state is a file, named by all that it depends on. It is never trusted: it is where Newton's
method starts on the section's own equations, which a state that belongs to them fulfils already.
A wrong or damaged file costs a few iterations and cannot change a result. Files are written
atomically; processes that need the same state at the same time each find it for themselves.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softehl.cases.seal.equations.equations import SealSystem
from softehl.cases.seal.equations.system import contact_kernels
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.records.numerics import Numerics
from softehl.cases.seal.gland.records.oil import Oil
from softehl.cases.seal.gland.surfaces import Surfaces
from softehl.cases.seal.solve.contact import contact_problem, correction_stage
from softehl.cases.seal.solve.path import Stage
from softehl.runtime.arrays import Array
from softehl.runtime.io import read_arrays, write_arrays
from softehl.runtime.kernels import load_kernel

WITHOUT_INFLUENCE = (
    *(*Seal.names, "ogden_terms"),  # values of others follow
    *(*Oil.model_fields, *Surfaces.model_fields, *Numerics.model_fields),
    *("cavitation", "cavitation_pressure", "cavitation_penalty", "shear_traction"),
    *("stroke", "speeds", "travel", "error_estimate", "tolerance", "upwinding"),
    *("pressure_order", "reynolds", "quadrature", "quadrature_points"),
)
"""Parameters that the contact stage does not know."""


def contact_key(parameters: Seal) -> str:
    """Name of a contact state: all parameters but those without influence, and the kernels."""
    kernels = contact_kernels(parameters)
    given = parameters.model_dump(exclude=set(WITHOUT_INFLUENCE))
    if parameters.outline is not None:
        given["outline"] = hashlib.sha256(Path(parameters.outline).read_bytes()).hexdigest()
    given["kernels"] = {name: load_kernel(name).signature for name in kernels}
    return hashlib.sha256(json.dumps(given, sort_keys=True).encode()).hexdigest()[:32]


@dataclass(frozen=True)
class ContactStore:
    """Contact states in a folder; without a folder there are none."""

    folder: Path | None = None

    def densities(self, parameters: Seal, among: Sequence[int]) -> list[int]:
        """Densities of which there is a state, good or not; finest first."""
        if self.folder is None:
            return []
        sections = [parameters.model_copy(update={"density": d}) for d in among]
        return sorted((p.density for p in sections if self._path(p).exists()), reverse=True)

    def read(self, system: SealSystem) -> Array:
        """Unknowns to start from; nan, which Newton's method rejects, where no file fits."""
        stored = read_arrays(self._path(system.parameters)) or {}
        x, layout = system.at_rest(), system.layout
        for name in _fields(system):
            part = stored.get(name)
            fits = part is not None and part.shape == (layout.count(name),)
            x[layout.part(name)] = part if fits else np.nan
        return x

    def keep(self, system: SealSystem, x: Array) -> None:
        """Leave the contact state x for others; a folder that cannot be written to is no error."""
        if self.folder is None:
            return
        parts = {name: x[system.layout.part(name)] for name in _fields(system)}
        with suppress(OSError):
            self.folder.mkdir(parents=True, exist_ok=True)
            write_arrays(self._path(system.parameters), parts)

    def _path(self, parameters: Seal) -> Path:
        assert self.folder is not None
        return self.folder / f"{contact_key(parameters)}.npz"


def _fields(system: SealSystem) -> tuple[str, ...]:
    """Fields of a contact state: film pressures, whose number depends on m_p, are all zero."""
    return tuple(field.name for field in system.contact_fields())


def stored_contact(system: SealSystem) -> Stage:
    """A stage of one step that verifies a stored state, or corrects it in a few iterations."""
    return correction_stage(
        system,
        contact_problem(system, system.parameters.sealed_pressure),
        method="newton, from a stored contact state",
    )
