"""A model as written, as a list of operations: each SymPy expression once, operands first.

This is made from the expressions that `language.sympy_tape` has noted, not from the graph of the
compiler. `reference_evaluator` defines the operations; here is only their order, and what each
depends on: points, arrays of arguments, local unknowns.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import sympy as sp
from sympy.core.relational import Relational
from sympy.logic.boolalg import BooleanAtom

from softehl.codegen.language.definition import Definition
from softehl.codegen.language.sympy_tape import (
    ExternalResult,
    FunctionResult,
    Implicit,
    Integral,
    Local,
    MatrixFunction,
    OfArray,
    Principal,
    Slope,
    SympyTape,
    Terms,
)

ARRAYS = ("coordinates", "dofs", "data", "parameters", "arrays")
"""Arrays of arguments that are the same for all points."""


@dataclass(frozen=True)
class ProgramStep:
    """One operation.

    name: what is done with the operands in the slots `args`; content: what else it needs.
    inner: operations of a `solve` (its equations), of a `slope` (from the symbol to the value), of
    a `stretches` (its energy), of an `isotropic` (its function). depends: arrays
    behind it. locals: local unknowns behind it.
    """

    slot: int
    name: str
    args: tuple[int, ...]
    content: Any
    varying: bool
    depends: frozenset[str]
    locals: frozenset[int]
    inner: tuple[ProgramStep, ...] = ()


@dataclass(frozen=True)
class Switch:
    """Switch of a model's behaviour at `slot` > `other`, as the model has it in `text`."""

    slot: int
    other: int | None
    text: str
    condition: bool


@dataclass
class Program:
    """All operations of a model; `main` are those without local unknowns.

    potentials: slot and frozen slots of each; fields: slot of each; updates: of new history of
    terms, a list of numbers each.
    """

    definition: Definition
    steps: list[ProgramStep] = field(default_factory=list)
    main: list[ProgramStep] = field(default_factory=list)
    potentials: list[tuple[int, tuple[int, ...]]] = field(default_factory=list)
    fields: list[int] = field(default_factory=list)
    updates: list[int] = field(default_factory=list)
    switches: list[Switch] = field(default_factory=list)

    def moved(self) -> set[int]:
        """Unknowns that the potentials see where they are not frozen, by number."""
        slots = set()
        for slot, frozen in self.potentials:
            for k in _needed(self.steps, [slot], stop=frozen):
                s = self.steps[k]
                if s.name == "input" and s.content[0] == "dofs":
                    slots.add(s.content[1])
        return slots

    def above(self, roots: Iterable[int]) -> list[ProgramStep]:
        """The operations of `main` that `roots` need, in order."""
        needed = _needed(self.steps, roots)
        return [s for s in self.main if s.slot in needed]


def program(d: Definition) -> Program:
    """The operations of a model."""
    made = _Builder(d.record)
    out = Program(d)
    for expression, frozen in d.record.potentials:
        out.potentials.append((made(expression), tuple(made(s) for s in frozen)))
    out.fields = [made(value) for _, value in (*d.record.fields, *d.record.history)]
    out.updates = [made(symbol) for _, symbol in sorted(d.record.updates, key=lambda u: u[0])]
    out.steps = made.steps
    out.main = [s for s in made.steps if not s.locals]
    out.switches = [s for s in made.switches if _changes(out, s)]
    return out


def _changes(p: Program, s: Switch) -> bool:
    """True if a switch depends on arguments, and on no local unknowns."""
    operands = [p.steps[k] for k in (s.slot, s.other) if k is not None]
    return not any(x.locals for x in operands) and any(x.depends or x.varying for x in operands)


_NAMES = (
    *("log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh"),
    *("asinh", "acosh", "atanh", "erf", "erfc"),
)
FUNCTIONS = {getattr(sp, name): name for name in _NAMES}
SATURATING = frozenset(
    {"exp", "tan", "sin", "cos", "atan", "sinh", "cosh", "tanh", "asinh", "erf", "erfc"}
)
"""Functions whose argument may be anything, and which are something else far from zero."""


class _Builder:
    """Slots of expressions, each made once."""

    def __init__(self, record: SympyTape) -> None:
        self.record = record
        self.steps: list[ProgramStep] = []
        self.switches: list[Switch] = []
        self._slots: dict[Any, int] = {}

    def __call__(self, expression: Any) -> int:
        """Slot of an expression; those below it come first."""
        waiting = [sp.sympify(expression)]
        while waiting:
            e = waiting[-1]
            if e not in self._slots:
                below = [c for c in self._children(e) if c not in self._slots]
                if below:
                    waiting += reversed(below)
                    continue
                self._slots[e] = self._made(e)
            waiting.pop()
        return self._slots[sp.sympify(expression)]

    def _children(self, e: Any) -> Sequence[Any]:
        if e in self.record.inputs:
            return ()
        meaning = self.record.meanings.get(e)
        if meaning is None:
            return (e.definition,) if hasattr(e, "definition") else self._parts(e)
        parts: Sequence[Any]
        match meaning:
            case Local():
                parts = ()
            case Integral():
                parts = (meaning.integrand,)
            case Implicit():
                parts = (*meaning.unknowns, *meaning.equations, *meaning.start)
            case Principal():
                parts = (*meaning.squares, meaning.energy, *meaning.entries)
            case Terms():
                parts = (*meaning.entries, sp.sympify(meaning.value), *meaning.amounts)
            case OfArray():
                parts = (meaning.amount, *meaning.args)
            case ExternalResult():
                parts = meaning.inputs
            case FunctionResult():
                parts = (*meaning.of.function, *meaning.of.entries)
            case Slope():
                parts = (meaning.value, meaning.by)
            case _:
                parts = (meaning,)
        return [sp.sympify(p) for p in parts]

    def _parts(self, e: Any) -> Sequence[Any]:
        if isinstance(e, sp.Piecewise):
            return [x for pair in e.args for x in (pair.cond, pair.expr)]
        if isinstance(e, sp.exp):
            return (e.args[0],)
        if isinstance(e, sp.Pow):
            return (e.base, e.exp)
        return () if e.is_Number else e.args

    def _at(self, *parts: Any) -> tuple[int, ...]:
        return tuple(self._slots[sp.sympify(p)] for p in parts)

    def _made(self, e: Any) -> int:
        if e in self.record.inputs:
            return self._argument(*self.record.inputs[e])
        meaning = self.record.meanings.get(e)
        if meaning is not None:
            return self._meaning(meaning)
        if hasattr(e, "definition"):
            return self._slots[e.definition]
        return self._operation(e)

    def _argument(self, array: str, index: int) -> int:
        varying = array not in ARRAYS
        depends = {"dofs"} if array == "interpolated" else {array} & set(ARRAYS)
        return self._add("input", (), (array, index), varying=varying, depends=depends)

    def _meaning(self, m: Any) -> int:
        match m:
            case Local():
                return self._add("local", ())
            case Integral():
                return self._add("integral", self._at(m.integrand), varying=False)
            case Implicit():
                return self._solution(m)
            case Principal():
                squares, energy = self._at(*m.squares), self._at(m.energy)
                inner = self._between(squares, energy)
                return self._add(
                    "stretches", self._at(*m.entries), (squares, energy[0]), inner=inner
                )
            case Terms():
                symbols, (value,) = self._at(*m.entries), self._at(m.value)
                numbers = tuple(self.record.inputs[a] for a in m.amounts)
                within = self._between(symbols, (value,))
                terms = (symbols, (value,), m.kind, numbers)
                return self._add("terms", self._at(*m.amounts), terms, inner=within)
            case OfArray():
                number = self.record.inputs[m.amount][1]
                return self._add("of array", self._at(m.amount, *m.args), (m.layout, number))
            case ExternalResult():
                key = ("external", m.function, m.inputs)
                if key not in self._slots:
                    self._slots[key] = self._add("external", self._at(*m.inputs), m.function)
                return self._add("item", (self._slots[key],), m.index)
            case FunctionResult():
                return self._add("item", (self._matrix_function(m.of),), m.index)
            case Slope():
                (value,), (by,) = self._at(m.value), self._at(m.by)
                inner = self._between((by,), (value,))
                return self._add("slope", (value, by), inner=inner)
        return self._add("same", self._at(m))

    def _solution(self, m: Implicit) -> int:
        key = (m.equations, m.unknowns)
        if key not in self._slots:
            unknowns, equations = self._at(*m.unknowns), self._at(*m.equations)
            start = self._at(*m.start)
            inner = self._between(unknowns, equations)
            content = (unknowns, equations)
            self._slots[key] = self._add("solve", start, content, inner=inner)
        return self._add("item", (self._slots[key],), m.index)

    def _matrix_function(self, m: MatrixFunction) -> int:
        if m not in self._slots:
            entries = self._at(*m.entries)
            inner: tuple[ProgramStep, ...] = ()
            content: tuple[tuple[int, ...], tuple[int, ...]] = ((), ())
            if m.function:
                (eigenvalue, f) = self._at(*m.function)
                inner, content = self._between((eigenvalue,), (f,)), ((eigenvalue,), (f,))
            self._slots[m] = self._add(m.kind, entries, content, inner=inner)
        return self._slots[m]

    def _operation(self, e: Any) -> int:
        at = self._at(*self._parts(e))
        if e.is_Number or isinstance(e, BooleanAtom) or e in (sp.pi, sp.E):
            return self._add("number", (), _constant(e))
        if isinstance(e, Relational):
            self.switches.append(Switch(at[0], at[1], f"{e.lhs} > {e.rhs}", True))
            return self._add(e.rel_op, at)
        simple = {
            **{sp.Add: "sum", sp.Mul: "product", sp.And: "and", sp.Or: "or", sp.Not: "not"},
            **{sp.Piecewise: "pieces", sp.ITE: "choice", sp.Max: "max", sp.Min: "min"},
            **{sp.Abs: "abs", sp.sign: "sign", sp.Heaviside: "heaviside"},
            **{sp.atan2: "arctangent", sp.exp: "exp", **FUNCTIONS},
        }
        for kind, name in simple.items():
            if isinstance(e, kind):
                self._switches(e, name, at)
                return self._add(name, at)
        if isinstance(e, sp.Pow):
            exponent = e.exp
            if exponent.is_Rational:
                fixed = Fraction(int(exponent.p), int(exponent.q))
                return self._add("fixed power", at[:1], fixed)
            return self._add("power", at)
        raise TypeError(f"{type(e).__name__} is no operation of a page")

    def _switches(self, e: Any, name: str, at: tuple[int, ...]) -> None:
        if name in ("max", "min"):
            self.switches += [
                Switch(at[0], b, f"{e.args[0]} > {x}", True)
                for b, x in zip(at[1:], e.args[1:], strict=True)
            ]
        elif name in ("abs", "sign", "heaviside", "arctangent"):
            self.switches += [
                Switch(a, None, f"{x} > 0", True) for a, x in zip(at, e.args, strict=False)
            ]
        elif name in SATURATING:
            self.switches.append(Switch(at[0], None, str(e), False))

    def _add(
        self,
        name: str,
        args: tuple[int, ...],
        content: Any = None,
        *,
        varying: bool | None = None,
        depends: Iterable[str] = (),
        inner: tuple[ProgramStep, ...] = (),
    ) -> int:
        slot = len(self.steps)
        local_unknowns: set[int] = {slot} if name == "local" else set()
        below = [self.steps[a] for a in args]
        if name in ("solve", "stretches", "isotropic", "terms"):
            unknowns, results = content[:2]
            below += [self.steps[k] for s in inner for k in s.args if k not in unknowns]
            below += [self.steps[k] for k in ((results,) if name == "stretches" else results)]
            hidden = set(unknowns)
        else:
            hidden = set()
        locals_ = frozenset(local_unknowns | {k for s in below for k in s.locals} - hidden)
        dependencies = frozenset(depends) | {x for s in below for x in s.depends}
        varies = any(s.varying for s in below) if varying is None else varying
        self.steps.append(
            ProgramStep(slot, name, args, content, varies, dependencies, locals_, inner)
        )
        return slot

    def _between(self, sources: Sequence[int], roots: Sequence[int]) -> tuple[ProgramStep, ...]:
        """Operations by which `roots` depend on `sources`, in order."""
        needed = _needed(self.steps, roots)
        allowed = set(sources) | {k for r in roots for k in self.steps[r].locals}
        reached = set(sources)
        for s in self.steps:
            inside = {k for x in s.inner for k in x.args}
            if s.slot in needed and s.locals <= allowed and reached & ({*s.args} | inside):
                reached.add(s.slot)
        return tuple(self.steps[k] for k in sorted(reached - set(sources)))


def _needed(
    steps: Sequence[ProgramStep], roots: Iterable[int], stop: Iterable[int] = ()
) -> set[int]:
    """Slots of all operations below `roots`, and they themselves; none below `stop`."""
    needed: set[int] = set(stop)
    waiting = list(roots)
    while waiting:
        slot = waiting.pop()
        if slot not in needed:
            needed.add(slot)
            s = steps[slot]
            waiting += s.args
            if s.name in ("solve", "isotropic", "terms"):
                waiting += s.content[1]
            elif s.name == "stretches":
                waiting.append(s.content[1])
    return needed


def _constant(e: Any) -> Any:
    if isinstance(e, BooleanAtom):
        return bool(e)
    if isinstance(e, sp.Rational):
        return Fraction(int(e.p), int(e.q))
    return "pi" if e is sp.pi else "e" if e is sp.E else str(e)
