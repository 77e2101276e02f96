"""Target `fortran`: a module with explicit interfaces over the C of a model, an example, a test."""

from __future__ import annotations

import re
from collections.abc import Sequence

from softehl.codegen.abi import TargetError, Task
from softehl.codegen.graph.evaluation import State
from softehl.codegen.hosts import abaqus_host as host
from softehl.codegen.hosts import c_interface, column_major, patch_mesh
from softehl.codegen.hosts.c_library import DIFFERENCE, LIMIT
from softehl.codegen.hosts.column_major import Array
from softehl.codegen.hosts.element_common import IN_FORTRAN, arguments
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.material_response import at_one_point
from softehl.codegen.hosts.registry import Host
from softehl.codegen.hosts.test_states import Sample, samples

LETTERS = 63
"""Longest name of Fortran 2018."""


def module(interface: ElementInterface, states: Sequence[State]) -> dict[str, str]:
    """Every file of target `fortran`."""
    _check_names(interface)
    texts, kernel = c_interface.files(interface)
    references = samples(interface, kernel, host.with_time_step(interface, states))
    solves = _solves(interface)
    substitutions = {
        "name": interface.name,
        "tasks": ", ".join(f"`{interface.name}_{t}`" for t in _procedures(interface)),
        "example": "call " + _call(interface, _first_task(interface)),
        "host": " host" if solves else "",
        "inputs": ", ".join(a.name for a in column_major.inputs(interface)),
        "arrays": _array_rows(interface),
    }
    texts[f"{interface.name}.f90"] = source(interface)
    texts["values.txt"] = column_major.sample_text(interface, references)
    texts["test.f90"] = test(interface)
    texts["example.f90"] = example(interface, references[0])
    if solves:
        texts |= _patch(interface, references)
    texts["Makefile"] = c_interface.filled(c_interface.template("fortran.mk"), substitutions)
    texts["NOTES.md"] = c_interface.filled(c_interface.template("fortran.md"), substitutions)
    return texts


FORTRAN = Host(element=module, material=at_one_point(module))


def _check_names(interface: ElementInterface) -> None:
    """Refuse names that Fortran cannot tell apart or hold."""
    seen: dict[str, str] = {}
    for task in _procedures(interface):
        name = f"{interface.name}_{task}"
        if len(name) > LETTERS or not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
            raise TargetError(
                f"target fortran has no name {name[:70]}: names begin with a letter and have at "
                f"most {LETTERS}; rename the page"
            )
        if name.lower() in seen:
            raise TargetError(
                f"{interface.name} offers {task} and {seen[name.lower()]}, which are one name in "
                "Fortran: rename the parameter"
            )
        seen[name.lower()] = task


def _procedures(interface: ElementInterface) -> list[str]:
    return [*interface.tasks, *(["commit"] if c_interface.commits(interface) else [])]


def _solves(interface: ElementInterface) -> bool:
    """True for an element with unknowns at nodes of a standard cell: a patch can be solved."""
    return interface.cell is not None and not interface.free and Task.TANGENT in interface.tasks


def _first_task(interface: ElementInterface) -> str:
    order = (Task.TANGENT, Task.RESIDUAL, Task.ENERGY, Task.FIELDS)
    return next((t for t in order if t in interface.tasks), interface.tasks[0])


def _lists(interface: ElementInterface, task: str) -> tuple[list[Array], list[Array]]:
    """Inputs and results of a procedure of the module."""
    given = column_major.inputs(interface)
    if task != "commit":
        more = column_major.direction(interface, task)
        return [*given, *more], column_major.results(interface, task)
    fields = column_major.results(interface, Task.FIELDS)
    return fields, [a for a in given if a.name == "data"]


def _call(interface: ElementInterface, task: str) -> str:
    given, results = _lists(interface, task)
    return f"{interface.name}_{task}({', '.join(a.name for a in [*given, *results])})"


def _array_rows(interface: ElementInterface) -> str:
    """Rows of a table of arrays and shapes."""
    rows = [row for t in interface.tasks for row in _lists(interface, t)]
    arrays = {a.name: a for row in rows for a in row}
    return "\n".join(f"| `{a.name}` | {_bounds(a)} | {a.meaning} |" for a in arrays.values())


def _bounds(a: Array) -> str:
    return ", ".join([*map(str, a.shape), *(["n"] if a.each else [])])


def source(interface: ElementInterface) -> str:
    """NAME.f90: constants, private interfaces of the C functions, procedures that check shapes."""
    title = " ".join(f"{interface.name}: {interface.definition.doc}".split())
    comment = [title, "", *c_interface.argument_rows(interface, "{}({})", 1)]
    constants = [
        f"  integer, parameter, public :: {interface.name}_n_{k.lower()} = {v}"
        for k, v in c_interface.sizes(interface).items()
    ]
    tasks = _procedures(interface)
    public = [f"  public :: {interface.name}_{t}" for t in tasks]
    return "\n".join(
        [
            "! Generated by softehl from a model page; do not edit.",
            "!",
            *(f"! {' '.join(line.split())}".rstrip() for line in comment),
            "!",
            "! Arrays are contiguous, their last index counts elements.",
            "! A value that does not exist comes out as not-a-number.",
            f"module {interface.name}",
            "  use, intrinsic :: iso_c_binding, only: c_double, c_size_t",
            "  implicit none",
            "  private",
            *constants,
            *public,
            "",
            "  interface",
            *(_interface(interface, t) for t in tasks),
            "  end interface",
            "",
            "contains",
            "",
            *(_procedure(interface, t) for t in tasks),
            c_interface.template("check.f90") + "end module",
            "",
        ]
    )


_C_ARGUMENTS = ("X", "u", "data", "p")


def _interface(interface: ElementInterface, task: str) -> str:
    """Interface of a C function, with arrays of assumed size."""
    given, results = _lists(interface, task)
    inputs = [a.name for a in given] if task == "commit" else [*_C_ARGUMENTS]
    inputs += [a.name for a in column_major.direction(interface, task)]
    names = ", ".join(["n", *inputs, *(a.name for a in results)])
    intent = "inout" if task == "commit" else "out"
    return "\n".join(
        [
            f"    subroutine c_{task}({names}) &",
            f"        bind(c, name='{interface.name}_{task}')",
            "      import :: c_double, c_size_t",
            "      integer(c_size_t), value :: n",
            f"      real(c_double), intent(in) :: {', '.join(f'{a}(*)' for a in inputs)}",
            f"      real(c_double), intent({intent}) :: "
            + ", ".join(f"{a.name}(*)" for a in results),
            "    end subroutine",
        ]
    )


def _declared(a: Array, intent: str) -> str:
    rank = ", ".join(":" * (len(a.shape) + a.each))
    return f"    real(c_double), intent({intent}), contiguous :: {a.name}({rank})"


def _procedure(interface: ElementInterface, task: str) -> str:
    """A procedure of the module: checks shapes, calls C, turns the tangent."""
    given, results = _lists(interface, task)
    name, arrays = f"{interface.name}_{task}", [*given, *results]
    counted = "fields" if task == "commit" else "u"
    passed = {a.name for a in arrays}
    inputs = [a.name for a in given] if task == "commit" else [*_C_ARGUMENTS]
    inputs += [a.name for a in column_major.direction(interface, task)]
    actual = [a if a in passed else "none" for a in inputs] + [a.name for a in results]
    turned = any(a.name == "tangent" for a in results) and not interface.symmetric
    counted_rank = 3 if task == "commit" else 2
    lines = [
        f"  ! {'; '.join(f'{a.name}({_bounds(a)}): {a.meaning}' for a in results)}.",
        f"  subroutine {_call(interface, task)}",
        *(_declared(a, "in") for a in given),
        *(_declared(a, "inout" if task == "commit" else "out") for a in results),
        "    integer :: n" + (", e" if turned else ""),
        *(["    real(c_double) :: none(1)"] if "none" in actual else []),
        f"    n = size({counted}, {counted_rank})",
        *(
            f"    call check_shape('{name}', '{a.name}', shape({a.name}), [{_bounds(a)}])"
            for a in arrays
        ),
        *(["    none = 0"] if "none" in actual else []),
        f"    call c_{task}(int(n, c_size_t), {', '.join(actual)})",
    ]
    if turned:
        lines += [
            "    do e = 1, n",
            "      tangent(:, :, e) = transpose(tangent(:, :, e)) ! C stores rows",
            "    end do",
        ]
    return "\n".join([*lines, "  end subroutine", ""])


def _numbers(values: Sequence[float]) -> str:
    """Values of an array constructor."""
    return _wrapped(
        [f"{v!r}d0" if "e" not in repr(v) else repr(v).replace("e", "d") for v in values], 4
    )


def _wrapped(texts: Sequence[str], width: int) -> str:
    """Texts with commas, so many a line."""
    rows = [", ".join(texts[k : k + width]) for k in range(0, len(texts), width)]
    return ", &\n    ".join(rows)


def example(interface: ElementInterface, first: Sample) -> str:
    """Example program that calls one function for one element and prints the result."""
    task = _first_task(interface)
    given, results = _lists(interface, task)
    s = first.state
    values = {"X": s.coordinates, "u": s.dofs, "data": first.data, "p": s.parameters}
    declared = [
        f"  real(real8) :: {a.name}({', '.join([*map(str, a.shape), *(['1'] if a.each else [])])})"
        for a in [*given, *results]
    ]
    filled = [
        f"  {a.name} = reshape([ &\n    {_numbers([float(v) for v in values[a.name]])}], "
        f"shape({a.name}))"
        for a in given
    ]
    return "\n".join(
        [
            f"! One element of {interface.name}: {task}.  Generated by softehl.",
            "program softehl_example",
            f"  use {interface.name}",
            "  implicit none",
            "  integer, parameter :: real8 = kind(1d0)",
            *declared,
            *filled,
            f"  call {_call(interface, task)}",
            f"  if (any({results[0].name} /= {results[0].name})) error stop 'no value'",
            *(f"  print '(a, *(1x, es22.14))', '{a.name}', {a.name}" for a in results),
            "end program",
            "",
        ]
    )


def test(interface: ElementInterface) -> str:
    """The test program."""
    given = column_major.inputs(interface)
    wanted = {a.name: a for t in interface.tasks if t in _EXPECTED for a in _lists(interface, t)[1]}
    order = [a for k in ("energy", "residual", "tangent", "fields") if (a := wanted.get(k))]
    data = next((a for a in given if a.name == "data"), None)
    if c_interface.commits(interface) and data is not None:
        order.append(Array("renewed", data.shape, "data after a step"))
    declared, read, spread = [], [], []
    for a in given:
        shape = ", ".join(map(str, a.shape))
        if a.each:
            declared.append(f"  real(real8) :: {a.name}({shape}, n)")
            read.append(f"  allocate (page_{a.name}({shape}, samples))")
            declared.append(f"  real(real8), allocatable :: page_{a.name}({_colons(a)})")
            spread.append(f"    {a.name}({_leading(a)}e) = page_{a.name}({_leading(a)}k)")
        else:
            declared.append(f"  real(real8) :: page_{a.name}({shape}), {a.name}({shape})")
        read.append(f"  read (file, *) page_{a.name}")
    for a in order:
        declared.append(f"  real(real8), allocatable :: page_{a.name}({_colons(a)})")
        read.append(f"  allocate (page_{a.name}({_bounds(a).replace('n', 'samples')}))")
        read.append(f"  read (file, *) page_{a.name}")
    if any(a.name == "p" for a in given):
        read.append("  p = page_p")
    checks = [_EXPECTED[t] for t in interface.tasks if t in _EXPECTED]
    smooth = not interface.definition.prescribed
    if smooth and {Task.ENERGY, Task.RESIDUAL} <= set(interface.tasks):
        checks.append(_RESIDUAL_BY_DIFFERENCES)
    if smooth and {Task.TANGENT, Task.RESIDUAL} <= set(interface.tasks):
        checks.append(_TANGENT_BY_DIFFERENCES)
    if c_interface.commits(interface):
        checks.append(_COMMIT)
    if Task.RESIDUAL in interface.tasks:
        checks.append(_NOT_A_NUMBER)
    s = c_interface.sizes(interface)
    return c_interface.filled(
        c_interface.filled(c_interface.template("test.f90"), {"checks": "".join(checks)} | _SELF),
        {
            "name": interface.name,
            "declarations": "\n".join(declared),
            "read": "\n".join(read),
            "spread": "\n".join(spread),
            "inputs": ", ".join(a.name for a in given),
            "unknowns": s["UNKNOWNS"],
            "fields": s["FIELDS"],
            "points": s["POINTS"],
            "limit": f"{LIMIT:g}".replace("e", "d"),
            "difference": f"{DIFFERENCE:g}".replace("e", "d"),
        },
    )


_SELF = {
    k: f"@{k}@" for k in ("name", "declarations", "read", "spread", "unknowns", "fields", "points")
} | {k: f"@{k}@" for k in ("inputs", "limit", "difference")}
"""Keys that the second filling replaces, after the checks are in."""


def _colons(a: Array) -> str:
    return ", ".join(":" * (len(a.shape) + a.each))


def _leading(a: Array) -> str:
    return "".join([":, "] * len(a.shape))


_EXPECTED: dict[str, str] = {
    Task.ENERGY: """  block
    real(real8) :: energy(n)
    call @name@_energy(@inputs@, energy)
    call say('energy', off(energy, page_energy), @limit@)
  end block
""",
    Task.RESIDUAL: """  block
    real(real8) :: residual(@unknowns@, n)
    call @name@_residual(@inputs@, residual)
    call say('residual', off([residual], [page_residual]), @limit@)
  end block
""",
    Task.TANGENT: """  block
    real(real8) :: residual(@unknowns@, n), tangent(@unknowns@, @unknowns@, n)
    call @name@_tangent(@inputs@, residual, tangent)
    call say('residual with tangent', off([residual], [page_residual]), @limit@)
    call say('tangent', off([tangent], [page_tangent]), @limit@)
  end block
""",
    Task.FIELDS: """  block
    real(real8) :: fields(@fields@, @points@, n)
    call @name@_fields(@inputs@, fields)
    call say('fields', off([fields], [page_fields]), @limit@)
  end block
""",
    Task.PRODUCT: """  block
    real(real8) :: residual(@unknowns@, n), tangent(@unknowns@, @unknowns@, n)
    real(real8) :: direction(@unknowns@, n), product(@unknowns@, n)
    integer :: e
    call random_number(direction)
    call @name@_tangent(@inputs@, residual, tangent)
    call @name@_product(@inputs@, direction, product)
    do e = 1, n
      residual(:, e) = matmul(tangent(:, :, e), direction(:, e))
    end do
    call say('product', maxval(abs(product - residual)) / maxval(abs(residual)), @limit@)
  end block
""",
}
_RESIDUAL_BY_DIFFERENCES = """  block
    real(real8) :: found(@unknowns@, n), right(n), left(n)
    integer :: j
    do j = 1, @unknowns@
      u(j, :) = u(j, :) + 1d-6
      call @name@_energy(@inputs@, right)
      u(j, :) = u(j, :) - 2d-6
      call @name@_energy(@inputs@, left)
      call spread_samples()
      found(j, :) = (right - left) / 2d-6
    end do
    call say('residual by differences of energy', off([found], [page_residual]), @difference@)
  end block
"""
_TANGENT_BY_DIFFERENCES = """  block
    real(real8) :: found(@unknowns@, @unknowns@, n), right(@unknowns@, n), left(@unknowns@, n)
    integer :: j
    do j = 1, @unknowns@
      u(j, :) = u(j, :) + 1d-6
      call @name@_residual(@inputs@, right)
      u(j, :) = u(j, :) - 2d-6
      call @name@_residual(@inputs@, left)
      call spread_samples()
      found(:, j, :) = (right - left) / 2d-6
    end do
    call say('tangent by differences of residual', off([found], [page_tangent]), @difference@)
  end block
"""
_COMMIT = """  block
    real(real8) :: fields(@fields@, @points@, n)
    call @name@_fields(@inputs@, fields)
    call @name@_commit(fields, data)
    call say('history', off([data], [page_renewed]), @limit@)
    call spread_samples()
  end block
"""
_NOT_A_NUMBER = """  block
    real(real8) :: good(@unknowns@, n), spoiled(@unknowns@, n), error
    call @name@_residual(@inputs@, good)
    u(:, 1) = sqrt(-abs(u(:, 1)) - 1)
    call @name@_residual(@inputs@, spoiled)
    call spread_samples()
    error = maxval(abs(good(:, 2:) - spoiled(:, 2:)))
    if (error /= error) error = 1
    call say('not-a-number stays in its element', error, 0d0)
  end block
"""


def _patch(interface: ElementInterface, references: Sequence[Sample]) -> dict[str, str]:
    """Files of a program that solves a patch by Newton's method, with history."""
    assert interface.cell is not None
    s = c_interface.sizes(interface)
    state = s["POINTS"] * s["POINT_DATA"]
    given = column_major.inputs(interface)
    fields = bool(interface.definition.fields) and Task.FIELDS in interface.tasks
    commit = [f"  call {interface.name}_commit(fields, data)"] * c_interface.commits(interface)
    commit += [f"  svars(:{state}) = data({s['DATA'] + 1}:, 1)"] * bool(state)
    commit += [f"  svars({state + 1}:) = [fields]"] * fields
    substitutions = {
        "name": interface.name,
        "order": _wrapped([str(k + 1) for k in interface.by_node()], 20),
        "inputs": ", ".join(a.name for a in given),
        "declarations": "\n".join(
            f"  real(real8) :: {a.name}({', '.join([*map(str, a.shape), *['1'][: a.each]])})"
            for a in given
            if a.name != "u"
        ),
        "coordinates": "" if s["DIMENSION"] == 0 else "  X(:, :, 1) = coords\n",
        "arguments": "".join(line[2:] for line in arguments(interface, IN_FORTRAN)),
        "old": f"  data({s['DATA'] + 1}:, 1) = svars(:{state})\n" if state else "",
        "unknowns": s["UNKNOWNS"],
        "shape": f"{s['FIELDS']}, {s['POINTS']}",
        "fields": f"  call {interface.name}_fields({', '.join(a.name for a in given)}, fields)\n"
        if fields
        else "",
        "commit": "".join(f"{line}\n" for line in commit),
    }
    settings = host.settings_of(interface, references[0])
    return {
        "element.f90": c_interface.filled(
            c_interface.template("fortran_element.f90"), substitutions
        ),
        "host.f90": host.program(interface),
        "samples.txt": host.sample_file(interface, references),
        "patch.txt": host.patch_file(interface, patch_mesh.patch(interface.cell), settings),
    }
