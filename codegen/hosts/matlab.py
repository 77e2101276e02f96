"""Target `matlab`: a MEX function for MATLAB and Octave with a help text, a test, a patch."""

from __future__ import annotations

from collections.abc import Sequence

from softehl.codegen.abi import Task
from softehl.codegen.graph.evaluation import EvaluationState
from softehl.codegen.hosts import abaqus_host as host
from softehl.codegen.hosts import c_interface, column_major, patch_mesh
from softehl.codegen.hosts.c_library import DIFFERENCE, LIMIT
from softehl.codegen.hosts.column_major import Array
from softehl.codegen.hosts.element_common import IN_MATLAB, arguments
from softehl.codegen.hosts.element_interface import ElementInterface
from softehl.codegen.hosts.material_response import at_one_point
from softehl.codegen.hosts.registry import Host
from softehl.codegen.hosts.test_states import Sample, samples


def mex(interface: ElementInterface, states: Sequence[EvaluationState]) -> dict[str, str]:
    """Every file of target `matlab`."""
    column_major.require_name(f"{interface.name}_mex", "matlab")
    texts, kernel = c_interface.files(interface)
    references = samples(interface, kernel, host.with_time_step(interface, states))
    solves = column_major.solves(interface)
    substitutions = _substitutions(interface, references) | {
        "patch": ", solve_patch" if solves else "",
        "patch_call": "; solve_patch;" if solves else "",
    }
    for name, template in {
        f"{interface.name}.m": "matlab.m.in",
        f"{interface.name}_mex.c": "matlab_mex.c",
        f"test_{interface.name}.m": "matlab_test.m.in",
        "build.m": "matlab_build.m.in",
        "Makefile": "matlab.mk",
        "NOTES.md": "matlab.md",
    }.items():
        texts[name] = c_interface.filled(c_interface.template(template), substitutions)
    texts["values.txt"] = column_major.sample_text(interface, references)
    if solves:
        texts |= _patch(interface, references)
    return texts


MATLAB = Host(element=mex, material=at_one_point(mex), arrays=True)


def _substitutions(interface: ElementInterface, references: Sequence[Sample]) -> dict[str, object]:
    """Values for the templates."""
    title = " ".join(f"{interface.name}: {interface.definition.doc}".split())
    rows = [title, "", *_usage(interface), ""]
    rows += [*c_interface.argument_rows(interface, "{}({})", 1)]
    names = interface.definition.unknowns
    fields = [name for name, _ in interface.definition.fields]
    return {
        "name": interface.name,
        "NAME": interface.name.upper(),
        "help": "\n".join(f"%   {' '.join(row.split(' '))}".rstrip() for row in rows),
        "sizes": ", ".join(
            f"'{k.lower()}', {v}" for k, v in c_interface.sizes(interface).items() if k != "FIELDS"
        )
        + f", 'unknown_names', {_cell(names)}, 'field_names', {_cell(fields)}",
        "cases": "".join(_case(interface, t) for t in column_major.procedures(interface)),
        "tasks": ", ".join(column_major.procedures(interface)),
        "arrays": column_major.array_rows(interface),
        "usage": "\n    ".join(_usage(interface)),
        "read": _read(interface, references),
        "inputs": _inputs(interface),
        "checks": _checks(interface),
        "limit": LIMIT,
        "difference": DIFFERENCE,
    }


def _cell(names: Sequence[str]) -> str:
    """A cell array as one value of `struct`."""
    return "{{" + ", ".join(f"'{n}'" for n in names) + "}}"


def _inputs(interface: ElementInterface) -> str:
    return ", ".join(a.name for a in column_major.inputs(interface))


def _usage(interface: ElementInterface) -> list[str]:
    """A call of each task in MATLAB."""
    return [_usage_of(interface, t) for t in column_major.procedures(interface)]


def _usage_of(interface: ElementInterface, task: str) -> str:
    inputs, results = column_major.lists(interface, task)
    right = [a.name for a in ([*inputs, *results] if task == "commit" else inputs)]
    left = ", ".join(a.name for a in results)
    left = f"[{left}]" if len(results) > 1 else left
    return f"{left} = {interface.name}('{task}', {', '.join(right)})"


def _case(interface: ElementInterface, task: str) -> str:
    """Lines of C of one task: inputs, results, call."""
    inputs, results = column_major.lists(interface, task)
    commit = task == "commit"
    arrays = [*inputs, *results] if commit else inputs
    counted = "fields" if commit else "u"
    k = [a.name for a in arrays].index(counted)
    size = 1
    for v in arrays[k].shape:
        size *= v
    lines = [
        f'    if (strcmp(task, "{task}") == 0) {{',
        f"        const size_t n = count(nrhs, prhs, {len(arrays)}, {k + 1}, {size});",
    ]
    for j, a in enumerate(arrays):
        shape = ", ".join(map(str, a.shape)) or "1"
        lines += [
            f"        const size_t shape_{a.name}[] = {{{shape}}};",
            f'        const double *{a.name} = given(prhs[{j + 1}], "{a.name}", '
            f"shape_{a.name}, {max(len(a.shape), 1)}, {'n' if a.each else 1}, {int(a.longer)});",
        ]
    for j, a in enumerate(results):
        shape = ", ".join(map(str, a.shape)) or "1"
        target = f"new_{a.name}" if commit else a.name
        lines += [
            f"        const size_t result_{a.name}[] = {{{shape}}};",
            f"        double *{target} = result(plhs, nlhs, {j}, result_{a.name}, "
            f"{max(len(a.shape), 1)}, n);",
        ]
    name = f"{interface.name}_{task}"
    if commit:
        lines += [
            f"        memcpy(new_data, data, n * {results[0].shape[0]} * sizeof(double));",
            f"        {name}((ptrdiff_t)n, fields, new_data);",
        ]
    else:
        passed = {a.name for a in arrays}
        actual = [a if a in passed else "NULL" for a in ("X", "u", "data", "p")]
        actual += [a.name for a in column_major.direction(interface, task)]
        actual += [a.name for a in results]
        lines += [f"        {name}((ptrdiff_t)n, {', '.join(actual)});"]
    if any(a.name == "tangent" for a in results) and not interface.symmetric:
        lines += [f"        transpose(tangent, n, {len(interface.definition.unknowns)});"]
    return "\n".join([*lines, "        return;", "    }", ""])


def _read(interface: ElementInterface, references: Sequence[Sample]) -> str:
    """Lines of the test that read values.txt."""
    lines = []
    for a in column_major.with_length(column_major.inputs(interface), references):
        if a.each:
            lines.append(_take(a, f"page.{a.name}"))
            lines.append(f"{a.name} = page.{a.name}({':, ' * len(a.shape)}turn);")
        else:
            lines.append(f"[{a.name}, numbers] = take(numbers, [{a.shape[0]}, 1]);")
    lines += [_take(a, f"page.{a.name}") for a in column_major.expected(interface)]
    return "\n".join(lines)


def _take(a: Array, target: str) -> str:
    shape = ", ".join(map(str, a.shape)) or "1"
    return f"[{target}, numbers] = take(numbers, [{shape}, samples]);"


def _checks(interface: ElementInterface) -> str:
    """Checks of the test for what the page offers."""
    tasks, name, inputs = set(interface.tasks), interface.name, _inputs(interface)
    unknowns = len(interface.definition.unknowns)
    lines = []
    if Task.ENERGY in tasks:
        lines += [
            f"W = {name}('energy', {inputs});",
            f"failures = failures + say('energy', off(W, page.energy, turn), {LIMIT});",
        ]
    if Task.RESIDUAL in tasks:
        lines += [
            f"R = {name}('residual', {inputs});",
            f"failures = failures + say('residual', off(R, page.residual, turn), {LIMIT});",
        ]
    if Task.TANGENT in tasks:
        lines += [
            f"[R, K] = {name}('tangent', {inputs});",
            "failures = failures + say('residual with tangent', off(R, page.residual, turn), "
            f"{LIMIT});",
            f"failures = failures + say('tangent', off(K, page.tangent, turn), {LIMIT});",
        ]
    if Task.FIELDS in tasks:
        lines += [
            f"f = {name}('fields', {inputs});",
            f"failures = failures + say('fields', off(f, page.fields, turn), {LIMIT});",
        ]
    if c_interface.commits(interface):
        lines += [
            f"renewed = {name}('commit', f, data);",
            f"failures = failures + say('history', off(renewed, page.renewed, turn), {LIMIT});",
        ]
    smooth = not interface.definition.prescribed
    for value, slope, text in (
        (Task.ENERGY, Task.RESIDUAL, "residual by differences of energy"),
        (Task.RESIDUAL, Task.TANGENT, "tangent by differences of residual"),
    ):
        if smooth and {value, slope} <= tasks:
            target = "found(j, :)" if slope == Task.RESIDUAL else "found(:, j, :)"
            lines += [
                "found = zeros(size(page." + slope + "(" + _all(slope) + "turn)));",
                f"for j = 1:{unknowns}",
                "  right = u; right(j, :) = right(j, :) + 1e-6;",
                "  left = u; left(j, :) = left(j, :) - 1e-6;",
                f"  {target} = ({name}('{value}', {_moved(interface, 'right')}) - "
                f"{name}('{value}', {_moved(interface, 'left')})) / 2e-6;",
                "end",
                f"failures = failures + say('{text}', off(found, page.{slope}, turn), "
                f"{DIFFERENCE});",
            ]
    if Task.RESIDUAL in tasks:
        lines += [
            "lost = u; lost(:, 1) = NaN;",
            f"R = {name}('residual', {inputs});",
            f"spoiled = {name}('residual', {_moved(interface, 'lost')});",
            "others = R(:, 2:end) - spoiled(:, 2:end);",
            "failures = failures + say('not-a-number stays in its element', "
            "largest(others(:)), 0);",
        ]
    lines += [
        "failures = failures + say('a wrong shape is refused', refused(@() "
        f"{name}('{interface.tasks[0]}', {_moved(interface, 'u(1:end-1, :)')})), 0);"
    ]
    return "\n".join(lines)


def _all(slope: str) -> str:
    return ":, " if slope == Task.RESIDUAL else ":, :, "


def _moved(interface: ElementInterface, u: str) -> str:
    return ", ".join(u if a.name == "u" else a.name for a in column_major.inputs(interface))


def _patch(interface: ElementInterface, references: Sequence[Sample]) -> dict[str, str]:
    """A function that solves a patch by Newton's method, with history."""
    assert interface.cell is not None
    s = c_interface.sizes(interface)
    state = s["POINTS"] * s["POINT_DATA"]
    settings = host.settings_of(interface, references[0])
    inputs, name = _inputs(interface), interface.name
    substitutions = {
        "name": name,
        "order": ", ".join(str(k + 1) for k in interface.by_node()),
        "parameters": s["PARAMETERS"],
        "data": s["DATA"] + state,
        "constants": s["DATA"],
        "state": state,
        "arguments": "".join(arguments(interface, IN_MATLAB)),
        "inputs": inputs,
        "commit": f"      data = {name}('commit', {name}('fields', {inputs}), data);\n"
        if c_interface.commits(interface)
        else "",
    }
    return {
        "solve_patch.m": c_interface.filled(
            c_interface.template("matlab_patch.m.in"), substitutions
        ),
        "patch.txt": host.patch_file(interface, patch_mesh.patch(interface.cell), settings),
    }
