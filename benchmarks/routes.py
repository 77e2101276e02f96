"""Who takes part in which case, and by which routes."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass

from benchmarks.problem import Case


@dataclass(frozen=True)
class Generator:
    """A module of ours with `derive(case, route)`, the package it needs, its routes by case.

    `others` are routes that were the fastest on no machine that we know: they run when all are
    asked for.
    """

    title: str
    module: str
    package: str
    routes: tuple[str, ...]
    others: tuple[str, ...] = ()
    others_q4_tangent: tuple[str, ...] = ()
    fbar: str = ""
    """Why there is no route to F-bar; empty where there is one."""

    def of(self, case: Case, *, every: bool) -> tuple[str, ...]:
        """The routes that apply, `every` one or those that have won somewhere."""
        if case.fbar and self.fbar:
            return ()
        if not every:
            return self.routes
        return self.routes + self.others + (self.others_q4_tangent if case is Case.Q4_B else ())

    @property
    def installed(self) -> bool:
        """True if the package can be imported."""
        return importlib.util.find_spec(self.package) is not None


OURS = Generator(
    "softehl",
    "benchmarks.softehl_route",
    "codegen",
    ("shipped page", "printed formula"),
    ("one lane",),
)
FFCX = Generator(
    "FFCx",
    "benchmarks.ffcx_route",
    "ffcx",
    ("printed", "J and F:F"),
    ("J, sum factorisation",),
    fbar="cannot express it in one kernel: a UFL integrand knows no other point than its own",
)
CASADI = Generator(
    "CasADi",
    "benchmarks.casadi_route",
    "casadi",
    ("SX, cse", "SX through F"),
    ("SX", "MX of SX points"),
    others_q4_tangent=("SX, Hessian",),
)
GENERATORS = (OURS, FFCX, CASADI)
