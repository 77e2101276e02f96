"""Parts of a report on runs of a seal."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from softehl.cases.harness.report.part import FinishedRun, Part, ReportPicture, ReportTable
from softehl.cases.harness.responses import titled
from softehl.cases.harness.resume import advice_of
from softehl.cases.seal.gland.rubbers.hardness import shore_band
from softehl.cases.seal.gland.tolerances import ToleranceRow, ring_sizes
from softehl.cases.seal.gland.trade.oil_names import read_oil_name
from softehl.cases.seal.gland.trade.parse_terms import bands
from softehl.cases.seal.gland.trade.service_names import service_cycles
from softehl.cases.seal.report import style
from softehl.cases.seal.report.bokeh_plots import curve_plot, film_plot, friction_plot
from softehl.cases.seal.report.gland_drawing import fit_numbers, gland_figure
from softehl.cases.seal.report.pictures import FIGURES, pictures_of
from softehl.cases.seal.sensitivity.quantities import CALLED
from softehl.cases.seal.states.leakage import LeakageRow, net_leakage
from softehl.cases.seal.states.state import FilmRow
from softehl.runtime.io import Cell

PRESSURES = "Stress in the ring, film pressure on the rod, contact pressure on housing and walls."
"""Text of the part of deformed sections."""


def parts(runs: Sequence[FinishedRun]) -> list[Part]:
    """Gland, deformed section, film, curve, friction, leakage, surfaces, tolerances."""
    section = Part("Deformed section", PRESSURES, pictures_of(runs, FIGURES["section"]))
    text = "The slider chooses the rod speed." if any(_several_speeds([r]) for r in runs) else ""
    film = Part("Film and pressure", text, plots=[film_plot(run) for run in runs])
    return [
        *(*_compared(runs), gland(runs), *_rubber(runs), section, film),
        *(_curve(runs), _friction(runs), *_leakage(runs), *_surfaces(runs), tolerances(runs)),
    ]


def cycle_parts(runs: Sequence[FinishedRun]) -> list[Part]:
    """Cycles in numbers, the pictures that the runs have, the glands."""
    columns = [c for c in runs[0].case.row.columns() if c.head]
    heads = [titled(c.meaning, c.unit) for c in columns]
    rows: list[Sequence[Cell]] = [
        (run.name, *(getattr(row, c.name) for c in columns), row.verdict)
        for run in runs
        for row in run.rows
    ]
    text = "A cycle is periodic where it differs from the one before by less than 1 %."
    tables = [ReportTable("Every cycle", ["run", *heads, "verdict"], rows)]
    titles = {"friction_loop": "Friction loop", "film_map": "Film over time and place"}
    pictures = (Part(title, pictures=_drawn(runs, name)) for name, title in titles.items())
    return [Part("Cycles", text, tables=tables), *(p for p in pictures if p.pictures), gland(runs)]


def _compared(runs: Sequence[FinishedRun]) -> list[Part]:
    """Materials, and leakage of a cycle, of several runs side by side."""
    if len(runs) < 2:
        return []
    p = [run.parameters for run in runs]
    names = [run.name for run in runs]
    rows: list[tuple[Cell, ...]] = [
        ("rubber", *(q.compound or q.material for q in p), ""),
        ("shear modulus", *(q.shear_modulus for q in p), "MPa"),
        ("oil", *(q.oil or "by its viscosity" for q in p), ""),
        ("viscosity", *(q.viscosity * 1e9 for q in p), "mPa s"),
        ("sealed pressure", *(q.sealed_pressure for q in p), "MPa"),
        ("rms height of the seal", *(q.roughness[1] or "smooth" for q in p), "um"),
    ]
    tables = [ReportTable("Materials", ("", *names, "unit"), rows)]
    nets = [{row.speed_mm_s: row for row in net_leakage(run.rows)} for run in runs]
    shared = [speed for speed in nets[0] if all(speed in net for net in nets[1:])]
    if shared:
        cells = [
            (s, *(q.travel * net[s].net_mm3_per_mm for q, net in zip(p, nets, strict=True)))
            for s in shared
        ]
        caption = "Leakage in a cycle out and back [mm3]; negative: dry on balance"
        tables.append(ReportTable(caption, ("rod speed |U| [mm/s]", *names), cells))
    return [Part("Materials and leakage side by side", tables=tables)]


def gland(runs: Sequence[FinishedRun]) -> Part:
    """The seals in their glands, and how they sit."""
    pictures = pictures_of(runs, lambda run: gland_figure(run.parameters))
    numbers = [fit_numbers(run.parameters) for run in runs]
    rows: list[tuple[Cell, ...]] = [
        (name, *(numbers_of_run[name][0] for numbers_of_run in numbers), unit)
        for name, (_, unit) in numbers[0].items()
    ]
    force = (runs[0].content.get("numbers") or {}).get("air_wall_N")
    if force is not None and len(runs) == 1:
        rows.append(("force on the wall of the air side", -float(force), "N"))
    table = ReportTable("How the ring sits", ("", *(run.name for run in runs), "unit"), rows)
    text = "The free section where it slides, and the gland it is pressed into; lengths in mm."
    return Part("Gland and ring", text, pictures=pictures, tables=[table])


def _rubber(runs: Sequence[FinishedRun]) -> list[Part]:
    """The fit of a rubber, where a run has one."""
    pictures = pictures_of(runs, FIGURES["fit"], lambda run: f"{run.name}: {run.parameters.fit}")
    return [Part("Rubber", "Tests and the material fitted to them.", pictures)] if pictures else []


def _curve(runs: Sequence[FinishedRun]) -> Part:
    notes = {run.name: run.case.notes(run.rows, advice_of(run.content, run.rows)) for run in runs}
    lines = [f"{name}: {note}" for name, some in notes.items() for note in some]
    lines += [
        f"{run.name}: rejected, no result: {run.case.named(run.rejected)}"
        for run in runs
        if run.rejected
    ]
    text = (
        "h* over the rod speed; bars are the estimated error, a hollow mark is a state whose "
        "verdict is not ok. 'ok' means right within the stated error, and within 2 %."
    )
    if _several_speeds(runs):
        return Part("Film thickness", text, plots=[curve_plot(runs)], lines=lines)
    return Part("Film thickness", text, pictures_of(runs, FIGURES["curve"]), lines=lines)


def _friction(runs: Sequence[FinishedRun]) -> Part:
    text = "Of the film on the rod, its magnitude."
    if _several_speeds(runs):
        return Part("Friction", text, plots=[friction_plot(runs)])
    lines = [
        f"{run.name}, {style.STROKES[row.stroke]}: "
        + (f"{abs(row.rod_friction_N):.4g} N" if isfinite(row.rod_friction_N) else "not known")
        for run in runs
        for row in run.rows
    ]
    return Part("Friction", text, lines=lines)


def _several_speeds(runs: Sequence[FinishedRun]) -> bool:
    """True if there are several speeds to draw over."""
    return len({abs(row.rod_speed_mm_s) for run in runs for row in run.rows}) > 1


def _leakage(runs: Sequence[FinishedRun]) -> list[Part]:
    """Leakage of a cycle, also for the travel of the run."""
    tables = []
    for run in runs:
        travel, titles, rows = run.parameters.travel, LeakageRow.titles(), net_leakage(run.rows)
        cycle = f"net in a cycle of {travel:g} mm out and back [mm3]"
        cells = [(*row.cells()[:2], travel * row.net_mm3_per_mm, *row.cells()[2:]) for row in rows]
        head = (*titles[:2], cycle, *titles[2:])
        if service := run.parameters.service:
            head = (*head, f"net in {service} [cm3]")
            cells = [
                (*cell, 1e-3 * row.net_mm3_per_mm * travel * _cycles(service, travel, row))
                for cell, row in zip(cells, rows, strict=True)
            ]
        if rows:
            tables.append(ReportTable(run.name, head, cells))
    text = (
        "Out minus in; negative: the instroke could take back more than there is, dry on balance."
    )
    return [Part("Leakage per cycle", text, tables=tables)] if tables else []


def _cycles(service: str, travel: float, row: LeakageRow) -> float:
    return service_cycles(service, travel, 2.0 * travel / row.speed_mm_s)


def _surfaces(runs: Sequence[FinishedRun]) -> list[Part]:
    """Stribeck curves and regimes, of the runs whose surfaces are rough."""
    heads = [c.title for c in FilmRow.columns() if c.name in _SURFACE]
    tables = [
        ReportTable(
            run.name, heads, [[getattr(row, name) for name in _SURFACE] for row in run.rows]
        )
        for run in runs
        if any(isfinite(row.lambda_ratio) for row in run.rows)
    ]
    text = (
        "Friction over eta U / p with the regimes, and what asperities carry. Lambda is the mean "
        "gap over the roughness of both surfaces."
    )
    pictures = pictures_of(runs, FIGURES["stribeck"])
    return [Part("Surfaces", text, pictures, tables=tables)] if tables else []


_SURFACE = (
    *("rod_speed_mm_s", "lambda_ratio", "regime", "mean_gap_um"),
    *("asperity_load_percent", "boundary_friction_percent"),
)


def tolerances(runs: Sequence[FinishedRun]) -> Part:
    """Tolerances of the input."""
    rows: list[tuple[str, str, str]] = []
    for run in runs:
        p = run.parameters
        rows += [
            (run.name, f"{key.replace('_', ' ')} = {value:g} mm", f"+- {tolerance:g} mm")
            for key, value, tolerance in ring_sizes(p.ring)
        ]
        rows += [
            (run.name, f"{name} = {band.nominal:g} mm", f"{band.low:g} to {band.high:g} mm")
            for name, _, band in bands(p.said, piston=p.piston)
        ]
        if p.shore_A is not None:
            low, high = shore_band(p.shore_A, p.polymer)
            rows.append(
                (run.name, f"shore_A = {p.shore_A:g}", f"+- 5: modulus {low:+.0f} to {high:+.0f} %")
            )
        if p.oil and read_oil_name(p.oil).grade:
            rows.append((run.name, f"oil = {p.oil}", "viscosity +- 10 % (ISO 3448)"))
    tables = [ReportTable("Of what was given", ("run", "key", "tolerance"), rows)] if rows else []
    tables += [table for run in runs for table in _bands(run)]
    text = "" if tables else "No key of these runs has a tolerance that is known here."
    return Part("Tolerances", text, pictures_of(runs, FIGURES["tornado"]), tables=tables)


def _bands(run: FinishedRun) -> list[ReportTable]:
    """Bands of the results by the tolerances, if the run has sensitivities."""
    rows_read = ToleranceRow.read(run.folder / "tolerances.csv")
    header = ("", "rod speed U [mm/s]", "likely change [%]", "at worst [%]", "most of it by")
    rows = [
        (
            *(CALLED[row.quantity][0], row.rod_speed_mm_s, row.likely_percent, row.worst_percent),
            f"{row.largest.replace('_', ' ')}, {row.largest_percent:.3g} %",
        )
        for row in rows_read
    ]
    return [ReportTable(f"{run.name}: changes that follow", header, rows)] if rows else []


def _drawn(runs: Sequence[FinishedRun], name: str) -> list[ReportPicture]:
    """The pictures of this name that the runs have."""
    paths = [(run.name, run.folder / f"{name}.png") for run in runs]
    return [ReportPicture(title, path.read_bytes()) for title, path in paths if path.exists()]
