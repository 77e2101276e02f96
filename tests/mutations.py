"""Small faults in the sources, one at a time, and the tests that must see each of them.

    python -m tests.mutations [--tests FOLDER] [NUMBER ...]

The sources are copied to a temporary folder; each fault is made there, the tests that should see it
are run up to the first that fails, and the fault is taken back.  Printed is one line a fault; the
exit code is 1 if one was not seen.  `--tests` takes the tests of another version, to compare two.

A fault on a page of the shipped models makes it differ from its C, which only the oracle sees;
where `generated` names a model, its C is made anew from the page, which only the references see.
The test that compares the C with what the generator writes now sees both and is never among them.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("benchmarks", "cases", "codegen", "docs", "generated", "runtime", "src", "tests")
PATIENCE = 600.0
"""Seconds after which tests count as hanging: the fault is seen."""

GENERATE = """
import sys
from softehl.codegen import pipeline
from softehl.codegen.models import ALL
from softehl.codegen.tools import build, output_files
for name, text in output_files.files([pipeline.compile_model(ALL[sys.argv[1]]())]).items():
    if name.startswith(sys.argv[1]):
        (build.GENERATED / name).write_text(text, encoding="utf-8")
"""


@dataclass(frozen=True)
class Fault:
    """A text in a file that becomes another one; tests: arguments of pytest."""

    file: str
    old: str
    new: str
    tests: str
    generated: str = ""


ORACLE = "tests/codegen/test_oracle.py"
FIELDS = "tests/codegen/test_fields.py"
REFERENCE = "tests/physics/test_kernels_against_reference.py"

FAULTS = (
    # the compiler
    Fault(
        "codegen/graph/partial_derivatives.py",
        "g.mul(g.const(Fraction(1, 2)), g.recip(n))",
        "g.mul(g.const(Fraction(1, 3)), g.recip(n))",
        "tests/codegen/test_differentiate.py",
    ),
    Fault(
        "codegen/graph/partial_derivatives.py",
        "(x, g.neg(g.mul(a, scale)))",
        "(x, g.mul(a, scale))",
        "tests/codegen/test_differentiate.py tests/codegen/test_tasks.py",
    ),
    Fault(
        "codegen/graph/differentiation.py",
        "sides[1].get(f, zero)",
        "sides[0].get(f, zero)",
        "tests/codegen/test_differentiate.py",
    ),
    Fault(
        "codegen/graph/divided_difference.py",
        "g.branch(there, second, otherwise)",
        "g.branch(there, otherwise, otherwise)",
        "tests/codegen/test_stretches.py",
    ),
    Fault(
        "codegen/emit/c_routines.py",
        "g * expm1(d) / d",
        "0.5 * (f + g)",
        "tests/codegen/test_stretches.py",
    ),
    Fault(
        "codegen/optimise/passes.py",
        "g.mul(square, a) if n % 2 else square",
        "g.mul(square, a) if n % 3 else square",
        "tests/codegen/test_passes.py",
    ),
    Fault(
        "codegen/optimise/passes.py",
        "tuple(sorted((*known, (c, False))",
        "tuple(sorted((*known, (c, True))",
        "tests/codegen/test_passes.py",
    ),
    Fault(
        "codegen/optimise/factoring.py",
        "(-sign if n.op is Op.SUB else sign, b)",
        "(sign, b)",
        "tests/codegen/test_passes.py",
    ),
    Fault(
        "codegen/emit/points/sum_factored_btab.py",
        "if turn[key] <= turn[mirrored[key]]",
        "if turn[key] < turn[mirrored[key]]",
        FIELDS,
    ),
    Fault(
        "codegen/emit/points/point_kernel.py",
        "(-P[{k}]) * L{axis}{m}",
        "(-P[{k}]) * L{m}{axis}",
        FIELDS,
    ),
    Fault(
        "codegen/emit/points/point_inputs.py",
        'return "".join(f" - {array}',
        'return "".join(f" + {array}',
        FIELDS,
    ),
    Fault(
        "codegen/language/boundary_model.py",
        "return [t[1][0], -t[0][0]]",
        "return [-t[1][0], t[0][0]]",
        "tests/runtime/test_study_fields.py",
    ),
    Fault(
        "codegen/emit/simd_printer.py",
        "m.op is not Op.CALL and all(",
        "m.op is not Op.CALL and any(",
        "tests/codegen/test_lanes.py",
    ),
    Fault(
        "codegen/elements/shapes.py",
        "c * (1 + a * xi) * (1 + b * eta) / 8",
        "c * (1 + a * xi) * (1 - b * eta) / 8",
        "tests/codegen/test_elements.py tests/codegen/test_dimensions.py",
    ),
    # pages: the C does not follow
    Fault(
        "codegen/language/kinematics.py",
        "(g[0] * J[1][1] - g[1] * J[1][0]) / detJ",
        "(g[0] * J[1][1] + g[1] * J[1][0]) / detJ",
        f"{ORACLE} -k solid_taylor",
    ),
    Fault(
        "codegen/models/film.py",
        "U / 2 * h - conductance * slope",
        "U / 2 * h + conductance * slope",
        f"{ORACLE} -k film_facet",
    ),
    Fault(
        "codegen/models/contact.py",
        "(sp.Max(a, b), True)",
        "(sp.Min(a, b), True)",
        f"{ORACLE} -k contact",
    ),
    Fault(
        "codegen/models/contact.py",
        "(-area * lam / rho, True)",
        "(area * lam / rho, True)",
        f"{ORACLE} -k contact",
    ),
    Fault(
        "codegen/models/roughness.py",
        "sp.exp(-(H - _JOINT) / 4)",
        "sp.exp(-(H - _JOINT) / 5)",
        f"{ORACLE} -k rough",
    ),
    Fault(
        "codegen/models/rheology.py",
        "3 * term / (2 * k + 3)",
        "3 * term / (2 * k + 4)",
        f"{ORACLE} -k eyring",
    ),
    Fault(
        "codegen/models/mixed_film.py",
        "narrowing**2 * conductance",
        "narrowing * conductance",
        f"{ORACLE} -k conserving",
    ),
    Fault(
        "codegen/models/restraints.py",
        "angle * (z**2 + r**2)",
        "angle * (z**2 - r**2)",
        f"{ORACLE} -k mean_rotation",
    ),
    # pages: the C follows
    Fault(
        "codegen/models/contact.py",
        "n_r * (u_z - z_old) - n_z * (u_r - r_old)",
        "n_r * (u_z - z_old) + n_z * (u_r - r_old)",
        f"{REFERENCE} -k contact_friction",
        "contact_friction",
    ),
    Fault(
        "codegen/models/film.py",
        "1 / (1 + widening**2), True",
        "1 / (1 + widening), True",
        f"{REFERENCE} -k film_upwind",
        "film_upwind",
    ),
    Fault(
        "codegen/language/energies.py",
        "(19, 7000)",
        "(19, 7001)",
        f"{REFERENCE} -k arruda_boyce",
        "solid_taylor_mean_arruda_boyce",
    ),
    Fault(
        "codegen/models/roughness.py",
        "z / 15 * (66 + z**2 * (30",
        "z / 15 * (66 + z**2 * (31",
        f"{REFERENCE} -k film_rough",
        "film_rough",
    ),
    # the runtime
    Fault(
        "runtime/discretisation/quadrature.py",
        "np.array([1.0, -1.0])",
        "np.array([-1.0, 1.0])",
        "tests/runtime/test_rules.py",
    ),
    Fault(
        "runtime/discretisation/quadrature.py",
        "(nodes[cell + 1] - xi) / width, -1.0 / width",
        "(nodes[cell + 1] - xi) / width, 1.0 / width",
        "tests/cases/test_slider_cavitation.py tests/cases/test_rough_film.py",
    ),
    Fault(
        "runtime/contact/search.py",
        "against[other]) < FACING",
        "against[other]) > FACING",
        "tests/runtime/test_touching.py",
    ),
    Fault(
        "runtime/contact/mortar_pair.py",
        "change = off[1] - w[:, 2, None, None] * normal[1]",
        "change = off[1] + w[:, 2, None, None] * normal[1]",
        "tests/runtime/test_touching_faces.py",
    ),
    Fault(
        "codegen/models/mortar_2d.py",
        "*(-v for v in at.M)]",
        "*(v for v in at.M)]",
        ORACLE,
    ),
    Fault(
        "codegen/models/mortar_2d.py",
        "(stick, friction > 0), (0, True)",
        "(stick, True)",
        "tests/runtime/test_motion_constraints.py -k bodies_in_contact",
        "mortar_22",
    ),
    Fault(
        "runtime/discretisation/element_blocks.py",
        "else self.data[part]",
        "else self.data[: len(self.dofs[part])]",
        "tests/runtime/test_assembly.py",
    ),
    Fault(
        "runtime/solve/continuation.py",
        "(t - b) / (a - b) for b",
        "(t - b) / (a + b) for b",
        "tests/runtime/test_continuation.py",
    ),
    Fault(
        "runtime/solve/solver_cascade.py",
        "failed.nearest if nearer else start",
        "failed.nearest",
        "tests/runtime/test_ladder.py",
    ),
    Fault(
        "runtime/solve/continuation.py",
        "previous**2 / (latest**2 - previous**2)",
        "previous / (latest - previous)",
        "tests/runtime/test_continuation.py",
    ),
    Fault(
        "runtime/solve/newton.py",
        "return previous <= latest <= self.stagnation",
        "return latest <= self.stagnation",
        "tests/runtime/test_newton.py",
    ),
    Fault(
        "runtime/solve/linear/schur_complement.py",
        "full[self.interior] -= self.factors",
        "full[self.interior] += self.factors",
        "tests/runtime/test_condensation.py",
    ),
    Fault(
        "cases/seal/correctors/nested_dissection.py",
        "np.subtract.at(r, self.known",
        "np.add.at(r, self.known",
        "tests/runtime/test_elimination.py",
    ),
    Fault(
        "runtime/discretisation/mass.py",
        "(places[some, :, 1] @ position.T)",
        "(places[some, :, 0] @ position.T)",
        "tests/runtime/test_modes.py",
    ),
    Fault(
        "runtime/mesh/cells.py",
        "self.rule(degree + max(volume, 0)",
        "self.rule(degree + max(volume - 2, 0)",
        "tests/runtime/test_orders.py",
    ),
    Fault(
        "runtime/discretisation/loads.py",
        "face.measured_rule(2 * face.order + _HIGHER, ring=ring)",
        "face.measured_rule(2 * face.order + _HIGHER - 4)",
        "tests/runtime/test_orders.py",
    ),
    Fault(
        "runtime/results/recovery.py",
        "max(_order(block, cell) - 1, 1)",
        "max(_order(block, cell) - 2, 0)",
        "tests/runtime/test_recovery.py",
    ),
    Fault(
        "runtime/results/recovery.py",
        "operator[_mirrored(cell)]",
        "operator",
        "tests/runtime/test_recovery.py",
    ),
    Fault(
        "runtime/mesh/cells.py",
        'if kind == "wedge6" else nodes',
        'if kind == "wedge" else nodes',
        "tests/runtime/test_output.py",
    ),
    Fault(
        "runtime/equations/stability.py",
        "pivots.negative - int(saddle.sum())",
        "pivots.negative",
        "tests/runtime/test_modes.py",
    ),
    Fault(
        "runtime/solve/arclength.py",
        "return r, K, column + along",
        "return r, K, column",
        "tests/runtime/test_follow.py",
    ),
    Fault(
        "runtime/solve/arclength.py",
        "angle <= limit and not",
        "angle <= 90.0 and not",
        "tests/runtime/test_follow.py",
    ),
    Fault(
        "runtime/contact/search.py",
        "limit *= 0.5",
        "limit *= 1.0",
        "tests/runtime/test_touching.py -k exactly",
    ),
    Fault(
        "runtime/solve/eigen.py",
        "factors.solve(G @ x)",
        "factors.solve(G @ x) / 1.01",
        "tests/runtime/test_modes.py",
    ),
    Fault(
        "runtime/discretisation/discrete_gradient.py",
        "s = 0.5 * (1.0 + xi)",
        "s = 0.5 + 0.0 * xi",
        "tests/runtime/test_dynamics.py",
    ),
    Fault(
        "runtime/analyses/time_integrators.py",
        "** 2, 0.5 - am + af",
        "** 2, 0.5 + am - af",
        "tests/runtime/test_dynamics.py",
    ),
    Fault(
        "runtime/analyses/bifurcation.py",
        "if change and not (folds == 1 and abs(change) == 1):",
        "if change:",
        "tests/runtime/test_bifurcation.py",
    ),
    Fault(
        "runtime/sensitivity/linearised_step.py",
        "csc_array(self._reduced.T) if turned",
        "self._reduced if turned",
        "tests/runtime/test_derivatives.py",
    ),
    Fault(
        "runtime/sensitivity/adjoint.py",
        "gradient[:, :, k] += (self.mu * after)",
        "gradient[:, :, k] -= (self.mu * after)",
        "tests/runtime/test_derivatives.py",
    ),
    Fault(
        "cases/seal/sensitivity/sensitivity.py",
        "linear.factorise(csc_array(K.T))",
        "linear.factorise(csc_array(K))",
        "tests/cases/test_sensitivity.py",
    ),
    Fault(
        "runtime/solve/continuation.py",
        "self.target_iterations / max(iterations, 1)",
        "max(iterations, 1) / self.target_iterations",
        "tests/runtime/test_continuation.py",
    ),
    # the cases
    Fault(
        "cases/seal/states/leakage.py",
        "- back.leak_rate_mm3_s / back.rod_speed_mm_s",
        "+ back.leak_rate_mm3_s / back.rod_speed_mm_s",
        "tests/cases/test_leakage.py",
    ),
    Fault(
        "runtime/discretisation/dofmap.py",
        "points in block.along.items() for column",
        "points in reversed(block.along.items()) for column",
        "tests/cases/test_cycle.py",
    ),
    Fault(
        "runtime/definition/line_fields.py",
        "return (Slot(name, 0), *inner, Slot(name, 1))",
        "return (Slot(name, 0), Slot(name, 1), *inner)",
        "tests/runtime/test_study_forms.py",
    ),
    Fault(
        "runtime/analyses/time_integrators.py",
        "-(1.0 + r), r**2 / (1.0 + r)",
        "-(1.0 + r), r / (1.0 + r)",
        "tests/runtime/test_march.py",
    ),
    Fault(
        "cases/seal/cycle/transient.py",
        "return 2.0 * reading.flux_air_mm2_s / U",
        "return 1.0 * reading.flux_air_mm2_s / U",
        "tests/cases/test_cycle.py tests/cases/test_leakage.py",
    ),
    Fault(
        "cases/seal/states/estimate.py",
        "self.other.h_star / self.film.h_star - 1.0",
        "self.film.h_star / self.other.h_star - 1.0",
        "tests/cases/test_estimate.py",
    ),
    Fault(
        "cases/seal/solve/contact_meshes.py",
        'kept = self.store.densities(p, densities) if p.solver == "auto" else []',
        "kept = list[int]()",
        "tests/cases/test_contact_store.py",
    ),
    Fault(
        "cases/seal/solve/squeeze_film.py",
        "rate=-1.0 / (tau",
        "rate=1.0 / (tau",
        "tests/cases/test_squeeze_film.py",
    ),
    Fault(
        "cases/seal/equations/loads.py",
        "self.sealed_pressure + here, 0.0] if out",
        "self.sealed_pressure - here, 0.0] if out",
        "tests/cases/test_entrance.py",
    ),
    Fault(
        "cases/seal/states/results.py",
        "film.along(h[_nodes(first)])",
        "h[_nodes(first)]",
        "tests/cases/test_results.py tests/cases/test_method.py",
    ),
    Fault(
        "cases/seal/gland/rubbers/materials.py",
        "float(K[0, 0, 0]) / 4.0",
        "float(K[0, 0, 0]) / 2.0",
        "tests/cases/test_materials.py",
    ),
    Fault(
        "cases/seal/gland/fit_geometry.py",
        "section * (1.0 - values",
        "section * (1.0 + values",
        "tests/cases/test_fitting.py tests/cases/test_catalogue.py",
    ),
    Fault(
        "cases/seal/gland/grooves.py",
        "(1.0 - part) * low + part * high",
        "part * low + (1.0 - part) * high",
        "tests/cases/test_grooves.py",
    ),
    Fault(
        "cases/seal/gland/trade/fit_names.py",
        "nominal + away, nominal + away + width",
        "nominal - away - width, nominal - away",
        "tests/cases/test_trade_names.py",
    ),
    Fault(
        "cases/seal/gland/tolerances.py",
        "2.0 * (wrong if",
        "1.0 * (wrong if",
        "tests/cases/test_grooves.py",
    ),
    Fault(
        "cases/seal/states/leakage.py",
        "volume * 1e5 / (2.0 * travel)",
        "volume * 1e5 / travel",
        "tests/cases/test_answer.py",
    ),
    # other programs
    Fault(
        "codegen/hosts/material_response.py",
        'F = m.define("F", (sp.eye(3) + E) * F0)',
        'F = m.define("F", F0 * (sp.eye(3) + E))',
        "tests/codegen/hosts/test_materials.py",
    ),
    Fault(
        "codegen/hosts/abaqus_element.py",
        'return f"-(U[{i}] - du[{i}]) * {rate}" if is_rate else f"U[{i}] - du[{i}]"',
        'return f"-(U[{i}] - du[{i}]) * {rate}" if is_rate else f"U[{i}]"',
        "tests/codegen/hosts/test_abaqus_element.py",
    ),
    Fault(
        "codegen/hosts/templates/calculix.c",
        "stress[i] = fields[1 + i] - beta[i];",
        "stress[i] = fields[i] - beta[i];",
        "tests/codegen/hosts/test_materials.py",
    ),
    # what runs and what is held are what was given
    Fault(
        "codegen/tools/import_record.py",
        "    for name in before:\n        del sys.modules[name]\n",
        "",
        "tests/codegen/test_neighbours.py",
    ),
    Fault(
        "codegen/tools/cache_store.py",
        'for path, told in stored["read"].items()',
        "for path, told in ()",
        "tests/codegen/test_neighbours.py -k table",
    ),
    Fault(
        "runtime/arrays.py",
        "copied = np.array(array, subok=False)",
        "copied = np.asarray(array)",
        "tests/runtime/test_ownership.py -k arrays",
    ),
)


def main() -> int:
    """Make the faults that were asked for, all by default."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutations")
    parser.add_argument("numbers", nargs="*", type=int, help="faults by number, from 1")
    parser.add_argument("--tests", type=Path, default=ROOT / "tests", help="folder of the tests")
    asked = parser.parse_args()
    numbers, missed = asked.numbers or range(1, len(FAULTS) + 1), list[int]()
    with tempfile.TemporaryDirectory(prefix="softehl-faults-") as scratch:
        copy = copied(Path(scratch), asked.tests.resolve())
        for number in numbers:
            fault, start = FAULTS[number - 1], time.monotonic()
            seen = made(fault, copy)
            seconds = time.monotonic() - start
            print(f"{number:3} {fault.file:40} {seconds:5.0f} s  {seen or 'NOT SEEN'}", flush=True)
            missed += [] if seen else [number]
    print(f"{len(list(numbers)) - len(missed)} of {len(list(numbers))} seen")
    return 1 if missed else 0


def copied(to: Path, tests: Path) -> Path:
    """The sources with these tests, as they stand in a clone."""
    skipped = shutil.ignore_patterns("__pycache__", "*.so", "*.sha256")
    for name in COPIED:
        source = tests if name == "tests" else ROOT / name
        shutil.copytree(source, to / name, symlinks=True, ignore=skipped)
    for path in ROOT.glob("*.*"):
        if path.is_file():
            shutil.copy(path, to)
    return to


def made(fault: Fault, copy: Path) -> str:
    """The test that sees a fault in the copy, empty if none does; the fault is taken back."""
    path, generated = copy / fault.file, copy / "generated"
    text = path.read_text(encoding="utf-8")
    if text.count(fault.old) != 1:
        raise SystemExit(
            f"{fault.file} holds {fault.old!r} {text.count(fault.old)} times, not once"
        )
    before = {p: p.read_bytes() for p in generated.iterdir() if p.is_file()}
    path.write_text(text.replace(fault.old, fault.new), encoding="utf-8")
    try:
        if fault.generated:
            run(copy, "-c", GENERATE, fault.generated)
        return failing(copy, fault.tests)
    finally:
        path.write_text(text, encoding="utf-8")
        for p, data in before.items():
            p.write_bytes(data)


def failing(copy: Path, tests: str) -> str:
    """The first test that fails, or why none ran."""
    words = ["-m", "pytest", "-x", "-q", "--tb=no", "-p", "no:cacheprovider", *tests.split()]
    try:
        done = run(copy, *words)
    except subprocess.TimeoutExpired:
        return "hangs"
    if done.returncode == 0:
        return ""
    found = re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)
    if found is None:
        raise SystemExit(f"no test ran: {tests}\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return found[1]


def run(copy: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Python in the copy, with what the user's cache would hold in a cache beside it."""
    fresh = {
        "PYTHONPATH": str(copy / "src"),
        "PYTHONDONTWRITEBYTECODE": "1",
        "SOFTEHL_CACHE": os.environ.get("SOFTEHL_CACHE", str(copy / "cache")),
    }
    return subprocess.run(
        [sys.executable, *words],
        cwd=copy,
        env={**os.environ, **fresh},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


if __name__ == "__main__":
    sys.exit(main())
