"""A boundary-value problem on a mesh: pages on cells and sides, loads, supports, a path, results.

    study = Study(Mesh.rectangle(48, 44, cells=(16, 16)))
    study.add("body", "solid.py", mu=0.4, kappa=0.9)
    study.load("right", u_y=0.0625)
    study.fix("left", u_x=0, u_y=0)
    result = study.solve(steps=10)
    result.at((48, 60))["u_y"]

Unknowns have the names that the pages give them; equal names on equal nodes are one unknown.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from softehl.runtime.analyses import arc_length_path, homogenisation, load_stepping, time_stepping
from softehl.runtime.analyses import buckling as analyses_buckling
from softehl.runtime.analyses import modes as analyses_modes
from softehl.runtime.analyses.arc_length_path import LoadPath
from softehl.runtime.analyses.bifurcation import Bifurcation
from softehl.runtime.analyses.buckling import Buckling
from softehl.runtime.analyses.callbacks import Series
from softehl.runtime.analyses.homogenisation import Cell
from softehl.runtime.analyses.initial_state import at_rest
from softehl.runtime.analyses.solver_options import SolverOptions
from softehl.runtime.analyses.time_integrators import MethodName, TimeIntegrator
from softehl.runtime.analyses.two_scales import add_unit_cells
from softehl.runtime.arrays import Array, Integers
from softehl.runtime.contact.rigid_surfaces import Cylinder, Plane, Polyline, Sphere
from softehl.runtime.definition import loads_and_supports
from softehl.runtime.definition.contact_sides import add_contact
from softehl.runtime.definition.element_blocks import (
    On,
    add_block,
    elements_on,
    form_of,
    geometry_of,
)
from softehl.runtime.definition.initial_values import add_initial_values
from softehl.runtime.definition.kernel_loading import KernelOrigin, Source
from softehl.runtime.definition.problem_definition import (
    Datum,
    Number,
    ProblemDefinition,
    StudyError,
    Where,
)
from softehl.runtime.definition.rigid_bodies import add_rigid_body
from softehl.runtime.discretisation.loads import Amount
from softehl.runtime.equations.mass_matrix import Masses
from softehl.runtime.equations.system import System
from softehl.runtime.equations.system_builder import build_system
from softehl.runtime.fit import least_squares
from softehl.runtime.fit import objective as inverse
from softehl.runtime.fit.jax_operation import Operation
from softehl.runtime.fit.least_squares import Bounds, Fit, Measured
from softehl.runtime.fit.objective import Objective, StudyEvaluations, varied_definition
from softehl.runtime.kernels.explanation import Explanation
from softehl.runtime.mesh.mesh import Mesh, MeshError, Predicate
from softehl.runtime.parallel.engine import AnyEngine
from softehl.runtime.parallel.linear_solver_choice import Linear
from softehl.runtime.results.explanation import explain_at
from softehl.runtime.results.modes import Modes
from softehl.runtime.results.result import Result
from softehl.runtime.sensitivity.input_parsing import By
from softehl.runtime.sensitivity.inputs import Key
from softehl.runtime.sensitivity.quantities import UserFunction
from softehl.runtime.solve.newton import Newton
from softehl.runtime.suggestions import short_list


@dataclass(eq=False)
class Study:
    """Boundary-value problem on a mesh: pages, loads, supports; `solve` and others solve it.

    Parameters
    ----------
    mesh : Mesh
        Mesh of the problem, without inverted cells.
    geometry : str, optional
        Geometry of a mesh in 2-D for pages of fields: "plane strain" (the default) or
        "axisymmetric", around the x axis. In the latter, loads and pressures act on whole rings.

    Raises
    ------
    MeshError
        A cell is inverted.
    StudyError
        The mesh does not allow the geometry.
    """

    mesh: Mesh
    geometry: str | None = None
    _definition: ProblemDefinition = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Raises MeshError for a cell that is turned inside out, StudyError for a geometry."""
        self.mesh.check()
        geometry_of(self.mesh, self.geometry)
        self._definition = ProblemDefinition(self.mesh, self._axisymmetric)

    def __setattr__(self, name: str, value: object) -> None:
        """Raises AttributeError for what a study is of."""
        if name in ("mesh", "geometry") and name in vars(self):
            raise AttributeError(
                f"{name} of a study cannot be changed: make another one, Study(mesh, geometry)"
            )
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        """Summary in one line."""
        definition = self._definition
        blocks = short_list(f"{b.name} ({b.kernel.name})" for b in definition.blocks.values())
        calls = Counter(["fix"] * len(definition.conditions) + [f.what for f in definition.forces])
        calls.update(start=len(definition.start), contact=len(definition.contacts))
        calls.update(rigid=len(definition.rigids))
        summary = (
            ", ".join(f"{count} {name}" for name, count in calls.items() if count) or "no loads"
        )
        kinds = ", ".join(f"{len(nodes)} {kind}" for kind, nodes in self.mesh.cells.items())
        return f"<Study: {kinds}; blocks: {blocks}; {summary}>"

    def __copy__(self) -> Study:
        """A study with a copy of the definition, on the same mesh."""
        return self._with_definition(self._definition.copy())

    def __deepcopy__(self, memo: object) -> Study:
        """As a copy: what was written down does not change."""
        return self.__copy__()

    def _with_definition(self, definition: ProblemDefinition) -> Study:
        """A study with the same geometry and another definition."""
        other = object.__new__(type(self))
        vars(other).update({**vars(self), "mesh": definition.mesh, "_definition": definition})
        return other

    # definition ---------------------------------------------------------------------------------

    def add(
        self,
        name: str,
        source: Source = None,
        *,
        material: Source = None,
        element: str | None = None,
        cell: Cell | None = None,
        on: On | Sequence[Sequence[int]] = None,
        cells: str | None = None,
        model: str | None = None,
        shared: Sequence[str] = (),
        called: Mapping[str, str] | None = None,
        along: Mapping[str, int | Integers] | None = None,
        rule: object = None,
        constant: bool = False,
        **given: Any,
    ) -> None:
        """Add elements of a page to all cells, to a group of cells, or to a side.

        Parameters
        ----------
        name : str
            Name of the block of elements. A page of fields on several kinds of cells makes a block
            for each, "body:quad4", "body:tri3".
        source : str, Path, Definition, Page or Kernel, optional
            The page: a file or function, a folder that `softehl generate` wrote, a Definition, a
            kernel, or the name of a kernel that ships. A page of fields takes any kind of cell.
        material : str, Path or Law, optional
            Instead of `source`: a stress law, for a body of it. A file, a function, or the name of
            a law that ships, such as "neo_hooke".
        element : str, optional
            Instead of `source`: an element of the library, such as "truss"; `softehl elements`
            lists them.
        cell : Cell, optional
            Instead of `source`: a periodic unit cell at every integration point, with
            `processes=2` in two processes. See docs/study.md.
        on : str, callable or array (n, k), optional
            A side; a page of one node has an element at each of its nodes. "interior" are the
            facets between cells. An array gives the elements themselves by their node numbers.
        cells : str, optional
            Group of cells. All cells if left out.
        model : str, optional
            Name of the model, if the source has several.
        shared : sequence of str
            Unknowns without a node that all elements share; else each element has its own.
        called : mapping of str to str, optional
            Name of an unknown on the page -> its name in the study.
        along : mapping of str to int or array (n, m), optional
            Fields that the page interpolates along its lines -> order of their polynomials, with
            nodal unknowns at both ends of a line; or numbers of their unknowns, from 0, which
            blocks share.
        rule : QuadratureRule, optional
            Quadrature in place of the page's own, as in `softehl.quadrature.gauss(4, 1)`.
        constant : bool
            True if the tangent does not depend on unknowns: it is evaluated once.
        **given : float, array, callable, Table or list
            Parameters of the page: numbers, or functions f(t) of the load factor. An array in place
            of a number is (n,) or (n, 1) by element, (n, points) by integration point, or by node
            of the mesh; a function whose argument is called x or X is one of the coordinates of the
            points (m, dim). Data of the page: a number, numbers (n,) of the elements, or a function
            of the elements' centres (n, dim). Data of points (`Model.point_data`): as parameters,
            but every function is one of coordinates; of history the initial values.
            `Model.nodal_data` by their declared name: one number for each node of the mesh, or a
            function of the nodes' coordinates. Curves (`Model.table`): two lists, ([20, 100], [1.2,
            1.1]), or a `Table`. Networks: layers, as `Model.network` says. Two are set by `march`
            and not given: `dt`, the length of a step, and the parameters of `Model.rates`.

        Raises
        ------
        StudyError
            An argument does not fit the page or the study.
        MeshError
            The mesh has no such side or group.
        ModelError
            The page is wrong.
        """
        geometry = geometry_of(self.mesh, self.geometry)
        form = form_of(name, shared, called, along, rule, constant)
        if cell is not None:
            if [source, material, element, model] != [None] * 4:
                raise StudyError(f"{name!r}: cell=...: leave page, material, element and model out")
            add_unit_cells(
                self._definition,
                name,
                cell,
                form,
                geometry=geometry,
                on=elements_on(name, on),
                cells=cells,
                options=given,
            )
            return
        add_block(
            self._definition,
            name,
            KernelOrigin.of(
                name, source, material=material, element=element, model=model, geometry=geometry
            ),
            form,
            on=elements_on(name, on),
            cells=cells,
            arguments=given,
        )

    def load(self, where: Where, **components: Amount) -> None:
        """Add a dead load on a side, per reference length or area, or forces at nodes.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int
            A side, or a predicate of coordinates (n, dim) for the faces of the boundary all of
            whose nodes it selects. Coordinates of one node, or node numbers, for forces.
        **components : float or callable
            Unknown -> load in its direction [MPa on a side, N/mm of a page that has a thickness, N
            at a node]. A number is multiplied by
            the load factor (in `march` it is constant); a function f(x, t) of coordinates (n, dim)
            gives the load (n,) itself.

        Raises
        ------
        StudyError
            A value is not a finite number or function.
        MeshError
            The mesh has no such side or node.

        Notes
        -----
        On straight sides of cells of order p, polynomials of degree p + 2 are integrated exactly. A
        body force is a page.
        """
        loads_and_supports.add_load(self._definition, where, components)

    def pressure(
        self, where: str | Predicate, value: Amount, *, of: Sequence[str] | None = None
    ) -> None:
        """Add a follower pressure: it acts on the deformed side, inwards.

        Parameters
        ----------
        where : str or callable
            A side, or a predicate of coordinates for faces of the boundary.
        value : float or callable
            Force per deformed length or area [MPa]. A number is multiplied by the load factor (in
            `march` it is constant); a function f(x, t) gives the pressure (n,) at reference
            coordinates (n, dim).
        of : sequence of str, optional
            Unknowns that are the displacements along x, y, z; u_x, u_y, u_z if left out.

        Raises
        ------
        StudyError
            The displacements do not match the dimension of the mesh.
        MeshError
            A face belongs to two cells or to none: it has no outside.
        """
        loads_and_supports.add_pressure(self._definition, where, value, of)

    def spring(self, where: Where, **stiffness: float) -> None:
        """Add a spring to the ground at each node of a side.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int
            A side, a group, a predicate of coordinates, node numbers, or coordinates of one node.
        **stiffness : float
            Unknown -> stiffness of the spring of each node [N/mm].

        Raises
        ------
        StudyError
            A stiffness is not finite.
        MeshError
            The mesh has no such side or node.
        """
        loads_and_supports.add_springs(self._definition, where, stiffness)

    def fix(self, where: Where, **values: Amount) -> None:
        """Prescribe unknowns at nodes.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int
            A side, a group, a predicate of coordinates, node numbers, or coordinates of one node.
        **values : float or callable
            Unknown -> its value. A number is multiplied by the load factor (in `march` it is
            constant); a function f(x, t) of coordinates (n, dim) gives the value (n,) itself.

        Raises
        ------
        StudyError
            A value is not a finite number or function.
        MeshError
            The mesh has no such side or node.
        """
        loads_and_supports.add_conditions(self._definition, where, values)

    def tie(
        self, where: Where, to: Where, *names: str, offset: Amount = 0.0, tolerance: float = 1e-6
    ) -> None:
        """Tie unknowns of one side to those of another, u(where) = u(to) + offset: periodicity.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int
            The side that is tied.
        to : str, callable, tuple of float or array of int
            The side with the same nodes but for a shift; or one place, to which all nodes of
            `where` are tied, so that they move as one.
        *names : str
            The unknowns.
        offset : float or callable
            Difference of the values; as a value of `fix`.
        tolerance : float
            Largest distance of partner nodes after the shift, relative to the size of the sides.

        Raises
        ------
        StudyError
            The sides have different nodes.
        MeshError
            The mesh has no such side, or is distributed over processes.

        Notes
        -----
        Nodes at one place that belong to bodies without a connection are tied body by body.
        """
        loads_and_supports.add_ties(
            self._definition, where, to, names, offset=offset, tolerance=tolerance
        )

    def rigid(
        self,
        where: Where | None = None,
        *,
        at: Sequence[float] | None = None,
        name: str = "rigid",
        rotations: Literal["finite", "small"] = "finite",
        of: Sequence[str] | None = None,
    ) -> str:
        """Let a side or a group move as a rigid body, and return the name of the body.

        `fix`, `load` and `spring` take this name: u_x, u_y and theta are the displacement and the
        angle of the body in 2-D; u_x, u_y, u_z and theta_x, theta_y, theta_z, a rotation vector, in
        3-D. `Result.at(name)` has its motion, `Result.reaction(name)` force and moment.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int, optional
            A side, a group, a predicate of coordinates, or node numbers. Left out, the body has no
            nodes: it moves the surface of a contact.
        at : tuple of float, optional
            Reference point (dim,) [mm], where forces and moments act; the middle of the box around
            the nodes if left out.
        name : str
            Name of the body.
        rotations : str
            "finite", or "small" for pages of small strain: the constraint is then linear.
        of : sequence of str, optional
            Displacements along x, y, z; u_x, u_y, u_z if left out.

        Returns
        -------
        str
            The name.

        Raises
        ------
        StudyError
            The name is taken, or the nodes leave a rotation undetermined.
        MeshError
            The mesh has no such side or node.

        Notes
        -----
        A load on theta is a moment [N mm]; in 3-D about an axis that does not turn. Moments and
        angles of plane strain are per thickness. Rotation vectors stay below a full turn, unless
        all three components are prescribed. Cells of a rigid group need no page.
        """
        return add_rigid_body(self._definition, where, at=at, name=name, rotations=rotations, of=of)

    def contact(
        self,
        side: str | Predicate,
        other: str | Predicate | Plane | Sphere | Cylinder | Polyline | None = None,
        *,
        friction: float | None = None,
        name: str = "contact",
        body: str | None = None,
        of: Sequence[str] | None = None,
        stiffness: float | None = None,
        depth: float | None = None,
        law: Source | None = None,
        model: str | None = None,
        reach: float | None = None,
        **parameters: Number,
    ) -> None:
        """Add contact with finite sliding: of two sides, a side with itself, or a rigid surface.

        Parameters
        ----------
        side : str or callable
            Side with the contact pressure as an unknown: the finer or the softer one.
            `Result.fields(name)` has its pressure and shear stress.
        other : str, callable or surface, optional
            The other side, or a rigid surface: `Plane`, `Sphere`, `Cylinder` or `Polyline`. Left
            out, `side` is in contact with itself.
        friction : float, optional
            Coulomb's coefficient of friction; 0 if left out.
        name : str
            Name of the block.
        body : str, optional
            Rigid body, by the name of `rigid`, with which the surface moves; at rest if left out.
        of : sequence of str, optional
            Displacements along x, y, z; u_x, u_y, u_z if left out.
        stiffness : float, optional
            Of the augmented Lagrangian [MPa/mm]. It changes the iterations, not the result; derived
            from the bodies if left out.
        depth : float, optional
            Penetration above which sides are not in contact [mm]; the thickness of the body if left
            out, for a rigid surface any.
        law : page, optional
            Law of contact in place of impenetrability and Coulomb's friction: a page, or its file,
            that says with `m.gap`, `m.slip` and `m.jump(T)` what acts between a point of the first
            side and its partner, per undeformed area of the first side.
        model : str, optional
            Which page, if the file of the law has several.
        reach : float, optional
            Gap up to which the law acts [mm]; the length of a face if left out.
        **parameters : float or callable
            Parameters of the law; functions of time are allowed.

        Raises
        ------
        StudyError
            The name exists, or an argument is not allowed.
        ModelError
            The law is wrong.
        MeshError
            The mesh has no such side.
        """
        add_contact(
            self._definition,
            name,
            (side, other),
            of,
            body=body,
            law=law,
            model=model,
            parameters=parameters,
            friction=friction,
            stiffness=stiffness,
            depth=depth,
            reach=reach,
        )

    def initial(
        self, where: Where | None = None, *, block: str | None = None, **values: Datum
    ) -> None:
        """Set initial values of unknowns, and of history and other data of integration points.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int, optional
            Of unknowns: nodes, as in `fix`. Of data of points: a group of cells, or a predicate of
            coordinates for the elements all of whose nodes it selects. Everywhere if left out.
        block : str, optional
            Block of the data of points; all blocks with such data if left out.
        **values : float, array or callable
            Name -> value. Unknown: a number, (n,) at the nodes, or a function of coordinates
            (n, dim). Data of points (`Model.point_data`), such as a plastic strain or a prestress:
            a number, an array by element, node or integration point of the block as in `add`, or a
            function of coordinates. Of two values for one place the later one counts.

        Raises
        ------
        StudyError
            A value is not finite or has a wrong shape, or there is no such block or data.
        MeshError
            The mesh has no such side, group or node.

        Notes
        -----
        What is not set is zero, data of points are as `add` gives them. `solve`, `march`, `follow`,
        `modes` and `buckling` begin with these values; `start=` of them, a result, has precedence
        for unknowns and history.
        """
        add_initial_values(self._definition, where, block, values)

    def start(self, where: Where | None = None, **values: Datum) -> None:
        """Set initial values: an older name of `initial`.

        Parameters
        ----------
        where : str, callable, tuple of float or array of int, optional
            As of `initial`.
        **values : float, array or callable
            As of `initial`.

        Raises
        ------
        StudyError
            As of `initial`.
        MeshError
            As of `initial`.
        """
        named: dict[str, Any] = dict(values)
        self.initial(where, **named)

    # analyses -----------------------------------------------------------------------------------

    def system(self, fields: Mapping[str, Sequence[str]] | None = None) -> System:
        """Return the discrete equations of the study.

        Parameters
        ----------
        fields : mapping of str to sequence of str, optional
            Name of a field -> its unknowns, which are numbered node by node, the fields in this
            order and before all other unknowns. Left out, each unknown is a field.

        Returns
        -------
        System
            Equations with their numbering of unknowns.

        Raises
        ------
        StudyError
            Statements contradict each other.
        """
        return build_system(self._definition, fields)

    def explain(
        self, element: int, t: float = 0.0, *, block: str | None = None, x: Array | None = None
    ) -> Explanation:
        """Return every named value of a page in one element, before anything is solved.

        Parameters
        ----------
        element : int
            Number of the element in its block, as messages name it.
        t : float
            Load factor.
        block : str, optional
            Name of the block; may be left out if there is one.
        x : array (n,), optional
            Unknowns; left out, the initial ones with the prescribed values at t.

        Returns
        -------
        Explanation
            Values at the quadrature points, and the first operation without a value, with the line
            of the page. `Result.explain` has those of a result.

        Raises
        ------
        UnknownNameError
            There is no such block; a KeyError.
        StudyError
            The block is not named, x has another shape, or a page needs the length of a time step.
        ArgumentError
            There is no such element.
        """
        return explain_at(self.system(), element, block, t, x)

    def integral(
        self, expression: str, where: str | None = None, *, block: str | None = None
    ) -> float:
        """Return the integral of an expression at the initial state: a volume, a mass.

        Parameters
        ----------
        expression : str
            As of `Result.integral`.
        where : str, optional
            As of `Result.integral`.
        block : str, optional
            As of `Result.integral`.

        Returns
        -------
        float
            The integral.

        Raises
        ------
        StudyError
            As of `Result.integral`.
        MeshError
            As of `Result.integral`.
        """
        return at_rest(self._definition).integral(expression, where, block=block)

    def solve(
        self,
        *,
        steps: int = 1,
        until: float = 1.0,
        start: Result | None = None,
        options: SolverOptions | None = None,
        newton: Newton | None = None,
        on_step: Callable[[Result], object] | None = None,
        engine: AnyEngine = None,
        linear: Linear = "auto",
        device: str | None = None,
        write: str | Path | Series | None = None,
        progress: bool | None = None,
        record: bool = False,
    ) -> Result:
        """Return the solution at load factor `until`, reached in load steps.

        Parameters
        ----------
        steps : int
            Number of load steps. They are cut where Newton's method fails, and grow again.
        until : float
            Load factor at the end.
        start : Result, optional
            A result of this or another study on the same mesh, which gives initial values, history
            and load factor; the equations are those of this study. If `until` is its load factor,
            the equations are solved there once.
        options : SolverOptions, optional
            The following arguments together; an argument that is given has precedence.
        newton : Newton, optional
            Settings of Newton's method.
        on_step : callable, optional
            Called with the Result of each converged step.
        engine : str or object, optional
            "serial", "petsc" (all processes of mpirun), or an engine with settings.
        linear : str
            Linear solver. "direct", "superlu" and "pardiso" factorise; "amg" is algebraic multigrid
            (pyamg) for displacements or one scalar; "matrix-free" assembles no matrix; "auto"
            selects by the size of the problem.
        device : str, optional
            With linear="matrix-free": "cuda" is a GPU, by CuPy; "emulated" runs its kernels on the
            processor, for tests.
        write : str or Path, optional
            A .pvd file; each converged step is written as a .vtu beside it.
        progress : bool, optional
            Report each step on stderr. Left out: in one line, if stderr is a terminal.
        record : bool
            Keep the previous steps, which derivatives need if pages have history, and the last
            factors of large problems.

        Returns
        -------
        Result
            The state at the end.

        Raises
        ------
        StudyError
            An argument is not allowed, or nothing prevents a rigid motion.
        NotConverged
            The end is not reached; its `reached` is the last Result, or None.
        """
        return load_stepping.solve(
            self._definition,
            steps=steps,
            until=until,
            start=start,
            on_step=on_step,
            options=SolverOptions.merged(
                options,
                newton=newton,
                engine=engine,
                linear=linear,
                device=device,
                write=write,
                progress=progress,
                record=record,
            ),
        )

    def march(
        self,
        *,
        dt: float,
        until: float,
        method: MethodName | TimeIntegrator = "euler",
        mass: Masses | None = None,
        velocity: Mapping[str, Datum] | None = None,
        rho_inf: float | None = None,
        tolerance: float | None = None,
        start: Result | None = None,
        checkpoint: str | Path | None = None,
        restart: str | Path | None = None,
        options: SolverOptions | None = None,
        newton: Newton | None = None,
        engine: AnyEngine = None,
        linear: Linear = "auto",
        device: str | None = None,
        write: str | Path | None = None,
        progress: bool | None = None,
        record: bool = False,
    ) -> Iterator[Result]:
        """Yield the results of time steps up to `until`.

        Parameters
        ----------
        dt : float
            Length of a step, of the first one if steps adapt to `tolerance` [s].
        until : float
            Time at the end [s].
        method : str or integrator
            `Euler()` (backward) or `BDF2()`. With inertia: `GeneralisedAlpha(rho_inf)`,
            `Newmark(beta, gamma)` (the trapezoidal rule), `Midpoint()` (conserves energy) or
            `CentralDifference()` (explicit, with as many stable steps as a result needs); results
            are then `Motion`. Short names: "euler", "bdf2", "generalised-alpha", "newmark",
            "midpoint", "explicit".
        mass : mapping, optional
            Densities by block, as of `Result.modes`; for methods with inertia.
        velocity : mapping of str to float or callable, optional
            Unknown -> initial velocity, a number or a function of coordinates (n, dim); for methods
            with inertia.
        rho_inf : float, optional
            Spectral radius of generalised-alpha at infinite frequency, in [0, 1]; 0.8 if left out.
        tolerance : float, optional
            Largest local error of a step, relative to the largest value of each unknown (of those
            with a rate, if there are any). Steps adapt to it. Left out, they are `dt`, or shorter
            where Newton's method fails.
        start : Result, optional
            State at the beginning, as in `solve`.
        checkpoint : str or Path, optional
            File that is rewritten after each step.
        restart : str or Path, optional
            A checkpoint of the same mesh, pages and unknowns. The march continues bitwise as if it
            had not stopped, with engine "petsc" on any number of processes. Another `dt` than
            before is the length of the next step.
        options : SolverOptions, optional
            The following arguments together; an argument that is given has precedence.
        newton : Newton, optional
            Settings of Newton's method.
        engine : str or object, optional
            As in `solve`.
        linear : str
            As in `solve`.
        device : str, optional
            As in `solve`.
        write : str or Path, optional
            As in `solve`; with `start` or `restart` the series continues.
        progress : bool, optional
            As in `solve`.
        record : bool
            As in `solve`.

        Yields
        ------
        Result
            State after each step; a `Motion` with inertia.

        Raises
        ------
        StudyError
            An argument is not allowed, or belongs to another method.
        NotConverged
            As in `solve`.

        Notes
        -----
        After each converged step history is committed, and values of the previous step (data u_old,
        `Model.rates`) are renewed.
        """
        return time_stepping.march(
            self._definition,
            dt=dt,
            until=until,
            method=method,
            mass=mass,
            velocity=velocity,
            rho_inf=rho_inf,
            tolerance=tolerance,
            start=start,
            checkpoint=checkpoint,
            restart=restart,
            options=SolverOptions.merged(
                options,
                newton=newton,
                engine=engine,
                linear=linear,
                device=device,
                write=write,
                progress=progress,
                record=record,
            ),
        )

    def follow(
        self,
        *,
        step: float,
        until: Callable[[Result], bool],
        start: Result | Bifurcation | None = None,
        detect: Literal["bifurcation"] | None = None,
        options: SolverOptions | None = None,
        newton: Newton | None = None,
        most: int = 1000,
        linear: Linear = "auto",
        write: str | Path | None = None,
        progress: bool | None = None,
    ) -> LoadPath:
        """Return the path from load factor 0 on by arc length; it passes limit points of the load.

        Parameters
        ----------
        step : float
            Longest arc length of a step; the first is a hundredth of it.
        until : callable
            Called with each Result; the path ends where it returns True.
        start : Result or Bifurcation, optional
            A result to begin with, as in `solve`; or a bifurcation, whose other branch is followed
            (`start.reversed`: to its other side).
        detect : str, optional
            "bifurcation": locate bifurcations, at the cost of a factorisation for each point. They
            are in `bifurcations` of the path.
        options : SolverOptions, optional
            The following arguments together; an argument that is given has precedence.
        newton : Newton, optional
            Settings of Newton's method.
        most : int
            Largest number of points.
        linear : str
            A linear solver that factorises.
        write : str or Path, optional
            As in `solve`.
        progress : bool, optional
            As in `solve`.

        Returns
        -------
        LoadPath
            Results in order, limit points and bifurcations.

        Raises
        ------
        StudyError
            An argument is not allowed.
        NotConverged
            The end is not reached; its `reached` is the last Result, or None.

        Notes
        -----
        The arc length counts the load factor, and the unknowns in units of their initial change per
        load factor; from a bifurcation on, the load factor relative to that of the bifurcation and
        displacements relative to the size of the mesh. Steps are cut where the path bends, so that
        the path does not depend on `step` (docs/study.md). History is committed after each point.
        """
        return arc_length_path.follow(
            self._definition,
            step=step,
            until=until,
            start=start,
            detect=detect,
            max_points=most,
            options=SolverOptions.merged(
                options, newton=newton, linear=linear, write=write, progress=progress
            ),
        )

    def periodic(self, *pairs: tuple[Where, Where], tolerance: float = 1e-6) -> Cell:
        """Return the study as a unit cell of a periodic material.

        Parameters
        ----------
        *pairs : tuple of two sides
            Opposite sides, a pair for each direction.
        tolerance : float
            Largest distance of partner nodes after a shift, relative to the size of the sides.

        Returns
        -------
        Cell
            `solve(F)` of it gives the mean stress P and its tangent A.

        Raises
        ------
        StudyError
            Sides of a pair have different nodes.
        """
        return homogenisation.periodic_cell(self._definition, pairs, tolerance)

    def modes(
        self,
        count: int = 6,
        *,
        mass: Masses | None = None,
        start: Result | None = None,
        options: SolverOptions | None = None,
        engine: AnyEngine = None,
        linear: Linear = "auto",
    ) -> Modes:
        """Return natural modes at rest, or about a state, the lowest first.

        Parameters
        ----------
        count : int
            Number of modes.
        mass : mapping, optional
            Densities by block, as of `Result.modes`.
        start : Result, optional
            State about which the modes are; at rest if left out.
        options : SolverOptions, optional
            The following arguments together; an argument that is given has precedence.
        engine : str or object, optional
            As in `solve`.
        linear : str
            As in `solve`.

        Returns
        -------
        Modes
            Frequencies and shapes. An unconstrained body has its rigid motions first, of frequency
            zero: three in 2-D, six in 3-D.

        Raises
        ------
        StudyError
            The state is not in equilibrium, or the body has no mass.
        """
        return analyses_modes.modes(
            self._definition,
            count,
            mass=mass,
            start=start,
            options=SolverOptions.merged(options, engine=engine, linear=linear),
        )

    def buckling(
        self,
        count: int = 1,
        *,
        start: Result | None = None,
        options: SolverOptions | None = None,
        newton: Newton | None = None,
        engine: AnyEngine = None,
    ) -> Buckling:
        """Return the smallest load factors of linear buckling, with their modes.

        Parameters
        ----------
        count : int
            Number of factors.
        start : Result, optional
            State at which the tangent is linearised; at rest if left out. Factors are more exact
            for a state near them.
        options : SolverOptions, optional
            The following arguments together; an argument that is given has precedence.
        newton : Newton, optional
            Settings of Newton's method.
        engine : str or object, optional
            As in `solve`.

        Returns
        -------
        Buckling
            Load factors, rising, and their modes.

        Raises
        ------
        StudyError
            An argument is not allowed, or nothing prevents a rigid motion.
        NotConverged
            The linear response is not found.

        Notes
        -----
        The tangent changes as along the linear response to loads and prescribed values that grow in
        proportion; a factor is where it becomes singular.
        """
        return analyses_buckling.buckling(
            self._definition,
            count,
            start=start,
            options=SolverOptions.merged(options, newton=newton, engine=engine),
        )

    def varied(self, values: Mapping[Key, float | Array]) -> Study:
        """Return a copy of the study with other values of inputs.

        Parameters
        ----------
        values : mapping
            Input -> value, {("rubber", "mu"): 0.5}; keys as of `Result.sensitivity`. A function of
            the study is multiplied by its value.

        Returns
        -------
        Study
            The copy.

        Raises
        ------
        StudyError
            The study has no such input, or a value has a wrong shape.
        """
        return self._with_definition(varied_definition(self._definition, values))

    def objective(
        self,
        what: str | UserFunction,
        *,
        by: By,
        at: tuple[float, ...] | str | None = None,
        reaction: str | None = None,
        **path: Any,
    ) -> Objective:
        """Return a quantity as a function of inputs (k,), with its gradient.

        Optimisers of SciPy take it.

        Parameters
        ----------
        what : str or callable
            The quantity, as in `Result.sensitivity`.
        by : mapping
            The inputs, as in `Result.sensitivity`.
        at : tuple of float, optional
            As in `Result.sensitivity`.
        reaction : str, optional
            As in `Result.sensitivity`.
        **path
            Arguments of `solve`, or of `march` if there is a `dt`.

        Returns
        -------
        Objective
            Called with inputs (k,) it returns the value and its gradient (k,).

        Raises
        ------
        StudyError
            The study has no such input.
        """
        return inverse.objective(
            self._definition, what, by=by, at=at, reaction=reaction, arguments=path
        )

    def in_jax(self, *, by: By, **path: Any) -> Operation:
        """Return all unknowns as a function of inputs (k,), for JAX.

        Parameters
        ----------
        by : mapping
            The inputs, as in `Result.sensitivity`, one after the other; `start` of the operation
            has their values.
        **path
            Arguments of `solve`, or of `march` if there is a `dt`.

        Returns
        -------
        Operation
            Function (k,) -> (n,) with an adjoint for `jax.grad`.

        Raises
        ------
        StudyError
            The study has no such input.
        """
        return Operation(StudyEvaluations.by(self._definition, by, path))

    def fit(
        self,
        measured: Measured,
        *,
        by: By,
        bounds: Bounds | None = None,
        sigma: float | Array | None = None,
        most: int = 100,
        method: Any = "gauss-newton",
        integrator: Any = None,
        **path: Any,
    ) -> Fit:
        """Fit inputs to measurements by least squares, from their present values on.

        Parameters
        ----------
        measured : mapping
            {(48, 60): {"u_y": 12.4}, "left": {"u_x": 0.3}}: unknowns at places, reactions at sides.
            A number is measured at the end; a list has a number for each step; a mapping is
            {load factor or time: number}.
        by : mapping
            The inputs, as in `Result.sensitivity`.
        bounds : mapping, optional
            Input -> (lower, upper), {("rubber", "mu"): (0, 1)}. Positive parameters and data of
            pages stay positive, unless their bounds allow other values. Weights of a convex network
            that must not be negative are not.
        sigma : float or array, optional
            Standard deviation of the measurements, one for all or one for each. Left out, all have
            the same weight, and the covariance follows from the residuals.
        most : int
            Largest number of evaluations.
        method : str
            "gauss-newton": the trust region of SciPy with the exact Jacobian. "newton": Newton's
            method with exact second derivatives, which takes fewer evaluations where the residuals
            stay large; its covariance holds there, too. Another value is the `method` of `march`.
        integrator : str or object, optional
            `method` of `march`, if `method` is that of the fit.
        **path
            Arguments of `solve`, or of `march` if there is a `dt`.

        Returns
        -------
        Fit
            Values, their covariance, residuals, and the last result.

        Raises
        ------
        StudyError
            The study has no such input, or the path no step at the time of a measurement.
        NotConverged
            The study has no solution for the present values.
        """
        return least_squares.fit(
            self._definition,
            measured,
            by=by,
            bounds=bounds,
            sigma=sigma,
            max_evaluations=most,
            method=method,
            integrator=integrator,
            arguments=path,
        )

    @property
    def _axisymmetric(self) -> bool:
        """True if sides are those of rings."""
        return self.geometry == "axisymmetric"


__all__ = ["MeshError", "Source", "Study", "StudyError"]
