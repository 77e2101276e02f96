"""Result of a study at one load factor: values at places, sums, fields in cells, files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from softehl.errors import UnknownNameError
from softehl.runtime.arrays import Array, read_only
from softehl.runtime.contact.pair_law import PairLawKernel, fields_of_law
from softehl.runtime.definition.problem_definition import Block, StudyError
from softehl.runtime.discretisation.problem import Problem
from softehl.runtime.equations.eigenproblems import natural_modes
from softehl.runtime.equations.mass_matrix import Masses
from softehl.runtime.equations.stability import negative_directions
from softehl.runtime.kernels.constitutive_model import ModelKernel, PointState
from softehl.runtime.kernels.explanation import Explanation
from softehl.runtime.mesh.plotting import picture_file, show_or_save
from softehl.runtime.results.explanation import block_called, explain_element
from softehl.runtime.results.integrals import integral, mean
from softehl.runtime.results.modes import Modes
from softehl.runtime.results.output import write_result
from softehl.runtime.results.plotting import picture_of
from softehl.runtime.results.point_values import point_values
from softehl.runtime.results.reactions import motion_of, reactions, support_forces
from softehl.runtime.results.recovery import nodal_fields
from softehl.runtime.sensitivity.hessian import HessianTerm, hessian_by_key, hessian_products
from softehl.runtime.sensitivity.input_parsing import By, components, inputs
from softehl.runtime.sensitivity.inputs import Input, Key
from softehl.runtime.sensitivity.jacobian import by_key, derivative, sensitivity
from softehl.runtime.sensitivity.quantities import UserFunction, quantity
from softehl.runtime.sensitivity.tape import Tape
from softehl.runtime.solve.solution import Point, Solution, Status
from softehl.runtime.suggestions import did_you_mean, join_names, short_list

if TYPE_CHECKING:
    from softehl.runtime.equations.system import System
    from softehl.runtime.mesh.mesh import Predicate


@dataclass(frozen=True, eq=False)
class Result:
    """Converged state of a study: values at places, fields, reactions, derivatives, files.

    Attributes
    ----------
    system : System
        Equations of the study.
    problem : Problem
        The equations at this load factor or time.
    point : Point
        Load factor or time, unknowns, and record of Newton's method.
    histories : mapping of str to array
        Block -> history of the elements of this process.
    trail : optional
        The step with the previous ones, from which derivatives are computed.

    Notes
    -----
    Under mpirun all processes call every method and get the same values; of a distributed mesh,
    values at nodes and cells are those of the own part.
    """

    system: System
    problem: Problem
    point: Point
    histories: Mapping[str, Array] = field(default_factory=dict)
    trail: Tape | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Histories that cannot be written to."""
        histories = {name: read_only(values) for name, values in self.histories.items()}
        object.__setattr__(self, "histories", histories)

    def __repr__(self) -> str:
        """Summary in one line."""
        global_system = self._global_system
        return (
            f"<{type(self).__name__} at t = {self.t:.6g}: {global_system.size} unknowns "
            f"({short_list(global_system.numbering.layout.names)}); "
            f"blocks: {short_list(global_system.blocks)}>"
        )

    def __copy__(self) -> Self:
        """Itself, as nothing of it changes."""
        return self

    def __deepcopy__(self, memo: object) -> Self:
        """Itself, as nothing of it changes."""
        return self

    @property
    def t(self) -> float:
        """Load factor, or time [s]."""
        return self.point.parameter

    @cached_property
    def x(self) -> Array:
        """All unknowns, (n,)."""
        return read_only(self.system.comm.gather(self.point.solution.x))

    @property
    def state(self) -> dict[str, Array]:
        """History of the quadrature points, block -> (cells, points, k)."""
        return self.system.comm.gather_state(self.histories)

    @property
    def iterations(self) -> int:
        """Newton iterations of the last step."""
        return self.point.solution.iterations

    @property
    def residual_norms(self) -> tuple[float, ...]:
        """Norms of the residuals of these iterations."""
        return self.point.solution.residual_norms

    def norm(self) -> float:
        """Return the 2-norm of all unknowns.

        Returns
        -------
        float
            The norm.
        """
        return self.system.comm.norm(self.x)

    def values(self, name: str) -> Array:
        """Return the values of an unknown.

        Parameters
        ----------
        name : str
            Name of the unknown.

        Returns
        -------
        array (points,)
            At every node, nan where there is none; of an unknown without nodes all of its values.

        Raises
        ------
        UnknownNameError
            There is no such unknown; a KeyError.
        """
        dofs = self._global_system.numbering.nodal.get(name)
        if dofs is None:
            layout = self._global_system.numbering.layout
            if name not in layout.names:
                suggestions = (
                    f"{did_you_mean(name, layout.names)}; there are {join_names(layout.names)}"
                )
                raise UnknownNameError(
                    f"no unknown {name!r}{self._field_called(name) or suggestions}"
                )
            return self.x[layout.part(name)]
        return np.where(dofs >= 0, self.x[dofs], np.nan)

    def _field_called(self, name: str) -> str:
        """A hint at the block whose field a name is, for messages."""
        for label, block in self._global_system.blocks.items():
            if name in (*block.kernel.fields, *block.kernel.internal):
                return (
                    f", but a field: fields({label!r})[{name!r}] has it at the points, "
                    f"at_nodes({label!r})[{name!r}] at the nodes"
                )
        return ""

    def gathered(self, name: str) -> Array:
        """Return an unknown at every node of the whole mesh, also of a distributed one.

        Parameters
        ----------
        name : str
            Name of an unknown at nodes.

        Returns
        -------
        array (points,)
            The same on all processes.

        Raises
        ------
        UnknownNameError
            There is no such unknown at nodes; a KeyError.
        """
        if name not in self._global_system.numbering.nodal:
            existing = ", ".join(self._global_system.numbering.nodal)
            raise UnknownNameError(f"no unknown {name!r} at nodes; there are {existing}")
        return self.system.comm.gather_nodes(self.values(name))

    def at(
        self, place: tuple[float, ...] | str, *, cells: str | None = None, block: str | None = None
    ) -> dict[str, float]:
        """Return the unknowns, or fields of a block, at a place, or the motion of a rigid body.

        Parameters
        ----------
        place : tuple of float, array or str
            Reference coordinates (dim,) [mm], or the name of a rigid body.
        cells : str, optional
            Group that contains the cell, where bodies meet that share no nodes.
        block : str, optional
            Block whose fields are returned in place of unknowns, interpolated between `at_nodes`;
            nan outside the block.

        Returns
        -------
        dict of str to float
            Name -> value, interpolated by the shape functions of the cell.

        Raises
        ------
        MeshError
            The place lies outside the mesh or group.
        """
        if isinstance(place, str):
            return dict(zip(*motion_of(self._global_system, place, self.x), strict=True))
        point = np.asarray(place, dtype=np.float64)[None]
        (row,) = point_values(self.system, self._field_data(block), point, cells)
        return row

    def along(
        self,
        start: tuple[float, ...],
        end: tuple[float, ...],
        count: int = 100,
        *,
        cells: str | None = None,
        block: str | None = None,
    ) -> dict[str, Array]:
        """Return the unknowns, or fields of a block, along a straight line.

        Parameters
        ----------
        start : tuple of float
            Reference coordinates (dim,) of the first place [mm].
        end : tuple of float
            Those of the last place.
        count : int
            Number of places, at equal distances.
        cells : str, optional
            As in `at`.
        block : str, optional
            As in `at`.

        Returns
        -------
        dict of str to array (count,)
            Name -> values; "s" is the distance from the start [mm].

        Raises
        ------
        MeshError
            A place lies outside the mesh or group.
        """
        a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        fractions = np.linspace(0.0, 1.0, count)
        points = a + fractions[:, None] * (b - a)
        rows = point_values(self.system, self._field_data(block), points, cells)
        names = [name for name in rows[0] if all(name in row for row in rows)]
        columns = {name: np.array([row[name] for row in rows]) for name in names}
        return {"s": fractions * float(np.linalg.norm(b - a)), **columns}

    def _field_data(self, block: str | None) -> Array | dict[str, Array]:
        """All unknowns, or the fields of a block at the nodes."""
        return self.x if block is None else self.at_nodes(block)

    def fields(self, block: str) -> dict[str, Array]:
        """Return the fields of a block at its quadrature points.

        Parameters
        ----------
        block : str
            Name of the block.

        Returns
        -------
        dict of str to array (cells, points)
            Field of the page (`m.fields(...)`) -> values; empty if the page declares none. Of a
            contact by a law (points,), where it acts, with the place `x`, `y`, `z` of the points
            and their undeformed `area`.

        Raises
        ------
        UnknownNameError
            There is no such block; a KeyError.
        """
        law = [
            b
            for b in self.problem.assembler.blocks
            if isinstance(b.kernel, PairLawKernel) and b.name.startswith(f"{block}: ")
        ]
        if law:
            return fields_of_law(law, self.point.solution.x, self.problem.parameters)
        self._block(block)
        comm = self.system.comm
        return {n: comm.gather_cells(block, v) for n, v in self._local_fields(block).items()}

    def unit_cell(self, block: str, element: int, point: int = 0) -> PointState:
        """Return the unit cell at an integration point of a body with `cell=...`.

        Parameters
        ----------
        block : str
            Name of the block.
        element : int
            Number of the element in its block.
        point : int
            Number of the integration point.

        Returns
        -------
        Homogenised
            Mean gradient F, stress P, moduli A, and `result` of the cell.

        Raises
        ------
        StudyError
            The block has no unit cells, or no such element or point.
        """
        kernel = self._block(block).kernel
        if not isinstance(kernel, ModelKernel):
            raise StudyError(f"unit_cell: {block!r} has none: it was not added with cell=...")
        elements = self.problem.assembler.block(block)
        counts = len(elements.dofs), self.histories[block].shape[1]
        if not (0 <= element < counts[0] and 0 <= point < counts[1]):
            raise StudyError(
                f"unit_cell: element {element}, point {point}: {block!r} has {counts[0]} elements "
                f"of {counts[1]} points, counted from 0"
            )
        arguments = elements.given(self.problem.parameters[block])
        dofs = self.point.solution.x[elements.dofs]
        return kernel.state(elements.coordinates, dofs, element, point, **arguments)

    def _block(self, name: str) -> Block:
        """The block of a name, of all processes.  Raises KeyError that names what there is."""
        return block_called(self._global_system.blocks, name)

    def _local_fields(self, block: str) -> dict[str, Array]:
        """Fields at the points of this process's elements."""
        fields = self.problem.fields(block, self.point.solution.x)
        new = [f"new_{name}" for name in self.system.blocks[block].kernel.history]
        return {name: values for name, values in fields.items() if name not in new}

    def integral(
        self, expression: str, where: str | None = None, *, block: str | None = None
    ) -> float:
        """Return the integral of an expression over the reference body, a group or a side.

        Parameters
        ----------
        expression : str
            Arithmetic of names, "mu / 2 * (I1 - 3)": fields, unknowns, parameters and data of a
            page, history after the step, values that the page names (`Model.define`), reference
            coordinates x, y, z, the load factor or time t, on sides the normal n_x, n_y, n_z; with
            sqrt, exp, log, sin, cos, tan, tanh, abs, sign, min and max. "energy" alone is what the
            page minimises, "1" the volume.
        where : str, optional
            Group of cells, or a side; all cells if left out.
        block : str, optional
            Block of the names; may be left out if the names say it.

        Returns
        -------
        float
            The integral, in axisymmetry over whole rings.

        Raises
        ------
        StudyError
            A name is not there, or several blocks have it; the mesh is distributed.
        MeshError
            There is no such side or group.

        Notes
        -----
        Names of pages are integrated by the quadrature of the page, coordinates and unknowns alone
        by a rule for twice the order of the cells.
        """
        return integral(self, expression, where, block)

    def mean(self, expression: str, where: str | None = None, *, block: str | None = None) -> float:
        """Return the mean of an expression over the reference body, a group or a side.

        Parameters
        ----------
        expression : str
            As of `integral`.
        where : str, optional
            Group of cells, or a side; all cells that have the names if left out.
        block : str, optional
            Block of the names; may be left out if the names say it.

        Returns
        -------
        float
            The integral divided by the volume, on sides by the area, of the elements that it is
            taken over; in axisymmetry of whole rings.

        Raises
        ------
        StudyError
            As of `integral`; the elements have no volume, or "energy" stands alone, which has no
            values at points.
        MeshError
            There is no such side or group.
        """
        return mean(self, expression, where, block)

    def explain(self, element: int, block: str | None = None) -> Explanation:
        """Return every named value of a page in one element, as `Kernel.explain`.

        Parameters
        ----------
        element : int
            Number of the element in its block.
        block : str, optional
            Name of the block; may be left out if there is one.

        Returns
        -------
        Explanation
            Values at the quadrature points, and the first operation without a value.

        Raises
        ------
        UnknownNameError
            There is no such block; a KeyError.
        StudyError
            The block is not named, or the mesh is distributed.
        ArgumentError
            There is no such element.
        """
        return explain_element(self.system, self.problem, self.point.solution.x, element, block)

    def at_nodes(self, block: str, *, recovery: str = "projection") -> dict[str, Array]:
        """Return the fields of a block at the nodes.

        Parameters
        ----------
        block : str
            Name of the block.
        recovery : str
            "projection" fits a polynomial to the quadrature points of each cell by least squares,
            of a degree one below the shape functions and at least 1; "mean" takes the mean of the
            points. A node has the mean of the cells of the block around it. "spr" is the
            superconvergent patch recovery of Zienkiewicz and Zhu: one order more, for fields that
            are smooth in the block.

        Returns
        -------
        dict of str to array (points,)
            Field -> values; nan outside the block.

        Raises
        ------
        UnknownNameError
            There is no such block; a KeyError.
        StudyError
            There is no such recovery, or "spr" of a distributed mesh.
        """
        self._block(block)
        if recovery == "spr" and self.system.mesh.piece is not None:
            raise StudyError('recovery = "spr" needs the whole mesh, and this one is distributed')
        fields = self.fields(block) if recovery == "spr" else self._local_fields(block)
        return nodal_fields(self.system, block, fields, recovery)

    @cached_property
    def _forces(self) -> Array:
        """Forces of supports, ties and springs, (n,): internal less external forces.

        They are zero to rounding where there are none.
        """
        local_forces = support_forces(self.problem, self.point.solution.x)
        return self.system.comm.gather_forces(local_forces)

    @property
    def _global_system(self) -> System:
        return self.system.everywhere

    def reaction(self, where: str | Predicate | Sequence[float]) -> dict[str, float]:
        """Return the sums of the forces of supports, ties and springs at the nodes of a side.

        Parameters
        ----------
        where : str, callable or tuple of float
            Side, group, predicate of coordinates, or coordinates of one node; or the name of a
            rigid body, for the force and the moment that hold it, about axes that do not turn.

        Returns
        -------
        dict of str to float
            Unknown -> force [N].

        Raises
        ------
        MeshError
            There is no such side.
        """
        return reactions(self.system, self._forces, where, self.x)

    @cached_property
    def unstable(self) -> int | None:
        """Number of independent directions in which the energy decreases; 0 of a stable state.

        None if there is no such number: the tangent is unsymmetric or singular.
        """
        return negative_directions(self.problem, self.point.solution.x)

    def modes(self, count: int = 6, *, mass: Masses | None = None) -> Modes:
        """Return natural modes about this state, with its prestress, the lowest first.

        Parameters
        ----------
        count : int
            Number of modes.
        mass : mapping, optional
            Block -> {"rho": density}, {"body": {"rho": 1e-9}}: mass per reference volume, in 2-D
            per area, a number or a function of coordinates (n, dim). It is that of u_x, u_y, u_z,
            or of the unknowns that "of" names. Pages with accelerations (`Model.rates(order=2)`)
            have their own.

        Returns
        -------
        Modes
            Frequencies and shapes. Supports and ties hold; unknowns without mass follow statically.

        Raises
        ------
        StudyError
            There is no mass, or the tangent is unsymmetric.
        """
        x = self.point.solution.x
        squares, shapes = natural_modes(self.system, self.problem, x, count, mass)
        return Modes(read_only(squares), tuple(ModeShape.of(self, mode) for mode in shapes))

    def sensitivity(
        self,
        what: str | UserFunction,
        *,
        by: By,
        at: tuple[float, ...] | str | None = None,
        reaction: str | None = None,
    ) -> dict[Key, float | Array]:
        """Return the derivatives of a quantity with respect to inputs.

        Parameters
        ----------
        what : str or callable
            An unknown at the place `at`, or its `reaction` at a side; or a function of all unknowns
            (n,) that returns its value and its gradient (n,).
        by : mapping of str to sequence of str
            The inputs: block -> parameters and data; "load:right" -> unknowns; "pressure:right" ->
            ["pressure"]; "spring:foot", "tie:left" and "fix:left" -> unknowns; "nodes" or
            "nodes:SIDE" -> axes, or modes {name: (points, dim)}.
        at : tuple of float or str, optional
            Reference coordinates (dim,), or the name of a rigid body.
        reaction : str, optional
            Name of a side or of a rigid body.

        Returns
        -------
        dict of tuple to float or array
            {("rubber", "mu"): number, ...}. Data have a number for each element, axes one for each
            node. An input that is a function is differentiated with respect to a factor of it.

        Raises
        ------
        StudyError
            The study has no such input, or the result no derivatives.
        MeshError
            The place lies outside the mesh.

        Notes
        -----
        The adjoint method, through all steps of a path with history. Load and time steps are held.
        """
        tape, selected = self._differentiated(by)
        return sensitivity(tape, quantity(what, at, reaction), selected)

    def hessian(
        self,
        what: str | UserFunction,
        *,
        by: By,
        at: tuple[float, ...] | str | None = None,
        reaction: str | None = None,
    ) -> dict[tuple[Key, Key], float | Array]:
        """Return the second derivatives of a quantity with respect to inputs.

        Parameters
        ----------
        what : str or callable
            As of `sensitivity`. A function of all unknowns returns its value, its gradient (n,) and
            its Hessian (n, n): an array, a sparse matrix or a LinearOperator.
        by : mapping of str to sequence of str
            The inputs, as in `sensitivity`.
        at : tuple of float, optional
            As in `sensitivity`.
        reaction : str, optional
            As in `sensitivity`.

        Returns
        -------
        dict of pairs of inputs to float or array
            {(("rubber", "mu"), ("load:right", "u_y")): number, ...}, for all pairs. Arrays have an
            axis for each input that has several components.

        Raises
        ------
        StudyError
            As of `sensitivity`, and for contact of bodies.
        MeshError
            The place lies outside the mesh.

        Notes
        -----
        Adjoints of second order, through all steps of a path with history: two linear solutions a
        step for each component of the inputs. For many components take `hessian_product`.
        """
        tape, selected = self._differentiated(by)
        count = sum(len(item.value) for item in selected)
        terms = [HessianTerm(tape, quantity(what, at, reaction))]
        return hessian_by_key(hessian_products(terms, selected, np.eye(count)), selected)

    def hessian_product(
        self,
        what: str | UserFunction,
        *,
        by: By,
        direction: Mapping[Key, float | Array],
        at: tuple[float, ...] | str | None = None,
        reaction: str | None = None,
    ) -> dict[Key, float | Array]:
        """Return the second derivatives of a quantity times a direction of the inputs.

        Parameters
        ----------
        what : str or callable
            As of `hessian`.
        by : mapping of str to sequence of str
            The inputs, as in `sensitivity`.
        direction : mapping of tuple to float or array
            {("rubber", "mu"): number, ...}: how inputs of `by` move; others rest. An array has a
            value for each component.
        at : tuple of float, optional
            As in `sensitivity`.
        reaction : str, optional
            As in `sensitivity`.

        Returns
        -------
        dict of tuple to float or array
            Rates of the derivatives of `sensitivity` along the direction.

        Raises
        ------
        StudyError
            As of `hessian`, and for a direction of another input or shape.
        MeshError
            The place lies outside the mesh.

        Notes
        -----
        Two linear solutions a step, and one for the adjoint, for any number of components.
        """
        tape, selected = self._differentiated(by)
        along = components(selected, direction)
        terms = [HessianTerm(tape, quantity(what, at, reaction))]
        return by_key(hessian_products(terms, selected, along[:, None])[:, 0], selected)

    def derivative(self, *, by: By) -> Array:
        """Return the derivatives of all unknowns with respect to inputs.

        Parameters
        ----------
        by : mapping of str to sequence of str
            The inputs, as in `sensitivity`.

        Returns
        -------
        array (n, k)
            Columns in the order of `by`.

        Raises
        ------
        StudyError
            As of `sensitivity`.
        """
        return derivative(*self._differentiated(by))

    def _differentiated(self, by: By) -> tuple[Tape, list[Input]]:
        definition = self.system.everywhere.definition
        if self.trail is None or definition is None:
            raise StudyError(
                "this result has no derivatives: results of solve, follow and march by euler "
                "or bdf2 have them"
            )
        self.trail.chain()
        return self.trail, inputs(definition, by)

    def deformed(self, names: tuple[str, ...]) -> Array:
        """Return the nodes' coordinates in the deformed state.

        Parameters
        ----------
        names : tuple of str
            Displacements along x, y, z.

        Returns
        -------
        array (points, dim)
            Reference coordinates plus displacements [mm].
        """
        displacements = np.stack([np.nan_to_num(self.values(name)) for name in names], axis=1)
        return np.asarray(self.system.mesh.points + displacements)

    def plot(
        self,
        name: str | None = None,
        *,
        block: str | None = None,
        deformed: bool | float = False,
        recovery: str = "projection",
        limits: tuple[float, float] | None = None,
        edges: bool = True,
        file: str | Path | None = None,
    ) -> None:
        """Show a picture of the body, or write it to a file.

        Parameters
        ----------
        name : str, optional
            Unknown ("u_y"), vector ("u": its length), field of the page ("sigma_xx"), or
            "von_mises" of the fields sigma_xx, ...; left out, the mesh alone.
        block : str, optional
            Block of the field; all blocks if left out, with means at common nodes.
        deformed : bool or float
            Displace nodes by u_x, u_y, u_z; a number is the factor of the displacements.
        recovery : str
            As of `at_nodes`.
        limits : tuple of float, optional
            Least and largest value of the colours.
        edges : bool
            Draw the edges of the cells.
        file : str or Path, optional
            Picture to write, such as "u.png" or "u.svg"; left out, it is shown in a window, or in
            a notebook interactively.

        Raises
        ------
        StudyError
            There is no such unknown or field, or the mesh is distributed.
        PictureError
            The file has another ending.
        MissingPyvista
            PyVista is not installed.
        """
        if file is not None:
            picture_file(file)
        picture = picture_of(
            self,
            name,
            block=block,
            deformed=deformed,
            recovery=recovery,
            limits=limits,
            edges=edges,
        )
        show_or_save(picture.draw(off_screen=file is not None), file)

    def write(self, path: str | Path) -> None:
        """Write the mesh with unknowns and fields to a file for ParaView.

        Parameters
        ----------
        path : str or Path
            "NAME.vtu": one file. "NAME.pvtu": one file for each process beside it, the only format
            of a distributed mesh. The folder is made.

        Raises
        ------
        StudyError
            The file has another ending, or cannot be written.

        Notes
        -----
        Fields are named BLOCK.FIELD, at nodes as by `at_nodes` and in cells as means. Unknowns u_x,
        u_y, u_z are also written as a vector u. The file is complete at any moment.
        """
        write_result(self, path, self._local_fields)


class ModeShape(Result):
    """Mode about a state: a Result whose unknowns are the mode; it has no fields."""

    @classmethod
    def of(cls, state: Result, mode: Array) -> ModeShape:
        """A mode (n,) about a state."""
        solution = Solution(mode, Status.CONVERGED, "", (), 0, 0)
        return cls(state.system, state.problem, replace(state.point, solution=solution))

    def fields(self, block: str) -> dict[str, Array]:
        """None."""
        return {}

    def _local_fields(self, block: str) -> dict[str, Array]:
        return {}
