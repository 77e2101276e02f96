"""The edge of a dry contact where a film is drawn in, and the film that theory predicts for it."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, inf

import numpy as np

from softehl.cases.seal.equations.film_heat import (
    inlet_mean,
    moving_half_space,
    warm_film,
)
from softehl.cases.seal.equations.inlet_theory import (
    Edge,
    ThinningOil,
    incremental_modulus,
    newtonian_inlet,
)
from softehl.cases.seal.equations.loads import Stroke
from softehl.cases.seal.equations.system import SealSystem
from softehl.cases.seal.gland.parameters import Seal
from softehl.cases.seal.gland.rubbers.materials import MATERIALS, incremental_stiffness
from softehl.cases.seal.states.contacts import contacts, excess_pressure
from softehl.runtime.arrays import Array, Integers

REACH, FEWEST_NODES = 3.0, 5
"""Length of the fit of K, in lengths of the inlet, and the nodes that it has at least."""

INSIDE = 20.0
"""Lengths of the inlet within the contact whose heat is counted in the inlet's."""

APPLIES = 0.1
"""Largest length of the inlet over the pocket before it: at 0.06 and 0.23 the theory was 2 and
11 % below the film of an instroke at p_s / mu = 5.4. Largest |b| l, too."""

SETTLED = 0.15
"""Largest difference of K^2 fitted over twice as many nodes, of sections with corners: at the tip
of a lip pressure has a peak, K^2 grew from 1291 to 4355 on four meshes, and a film of 8 um opens
what should be 0.16 um."""

PASSES = 0.9
"""Least h* of another contact over that of the first one on the way of the oil: the pressure of the
groove between them lets the same flux pass both."""


@dataclass(frozen=True)
class Prediction:
    """Film thickness by the theory of the inlet.

    Attributes
    ----------
    h_star : float
        Film thickness h*, mm.
    over_pocket : float
        Length of the inlet over the pocket of oil before it.
    edge : Edge
        The edge of the dry contact.
    length : float
        Length l of the inlet, mm.
    unsettled : float
        Relative difference of K^2 fitted over twice as many nodes; 0 of a round section.
    inlet_rise : float
        Rise of the temperature in the inlet by its friction, K; 0 without heating.
    """

    h_star: float
    over_pocket: float
    edge: Edge
    length: float
    unsettled: float = 0.0
    inlet_rise: float = 0.0

    @property
    def applies(self) -> bool:
        """True if the pocket is long enough not to change with the film, the edge short enough."""
        curved = abs(self.edge.curvature) * self.length
        return max(self.over_pocket, curved) <= APPLIES

    def difference(self, h_star: float) -> float:
        """Difference of the theory from a film thickness h* (mm), %."""
        return 100.0 * (self.h_star / h_star - 1.0)


@dataclass(frozen=True)
class Predictions:
    """Film thicknesses by the theory, of one contact or several.

    Attributes
    ----------
    contacts : tuple of Prediction
        One of each contact, in the order in which the oil passes them.
    stroke : "out" or "in"
        Direction of the rod.
    """

    contacts: tuple[Prediction, ...]
    stroke: Stroke

    @property
    def first(self) -> Prediction:
        """Prediction of the first contact on the way of the oil, whose flux passes the others too.

        Where another one would draw in more, it is starved. Where it would draw in less, oil fills
        the groove before it, whose pressure takes load off this contact until it lets the flux
        pass.
        """
        return self.contacts[0]

    @property
    def h_star(self) -> float:
        """Film thickness h*, mm."""
        return self.first.h_star

    @property
    def over_pocket(self) -> float:
        """Length of the inlet over the pocket of oil before it."""
        return self.first.over_pocket

    @property
    def passing(self) -> float:
        """Least h* of a contact over that of the first one, at most 1."""
        return min(contact.h_star for contact in self.contacts) / self.h_star

    @property
    def applies(self) -> bool:
        """True if the theory applies to the first contact and the others let its flux pass."""
        return self.first.applies and self.passing >= PASSES

    @property
    def from_sealed_side(self) -> tuple[Prediction, ...]:
        """Predictions of each contact, from the sealed side on."""
        return self.contacts if self.stroke == "out" else self.contacts[::-1]

    def difference(self, h_star: float) -> float:
        """Difference of the theory from a film thickness h* (mm), %."""
        return self.first.difference(h_star)


def predicted(
    system: SealSystem,
    x: Array,
    stroke: Stroke,
    speed: float,
    sealed_pressure: float | None = None,
) -> Predictions | None:
    """The films at |U| over a dry contact x (n,) by the theory of the inlet.

    The oil before an inlet has the pressure of the sealed side on an outstroke, also in a groove,
    and none on an instroke.

    Parameters
    ----------
    system, x
        The dry contact.
    stroke : "out" or "in"
        Direction of the rod.
    speed : float
        |U|, mm/s.
    sealed_pressure : float, optional
        Pressure of the oil before the inlet of an outstroke, MPa; left out, that of the contact.

    Returns
    -------
    Predictions or None
        None if a contact of the section has too few nodes, if the pressure at the edge of the first
        one is no root, or if the oil thins more than the theory can be solved for.
    """
    p = system.parameters
    touching = contacts(system, x) if p.predictable else []
    pressure = 0.0
    if stroke == "out":
        pressure = p.sealed_pressure if sealed_pressure is None else sealed_pressure
    flow = p.viscosity * exp(p.pressure_viscosity * pressure) * speed
    surface = _Surface.of(system, x)
    along = touching if stroke == "out" else [nodes[::-1] for nodes in reversed(touching)]
    found = list[Prediction]()
    for k, nodes in enumerate(along):
        drawn_in = surface.drawn_in(p, nodes, speed, flow, along[k - 1] if k else None)
        if drawn_in is None:
            return None
        found.append(drawn_in)
    if not found or found[0].unsettled > SETTLED:
        return None
    return Predictions(tuple(found), stroke)


def warm_inlet(p: Seal, edge: Edge, flow: float, speed: float) -> tuple[float, float]:
    """Viscosity of the warm inlet over that of the cold oil, and its rise of the temperature, K.

    The heat is that of the local problem, from the end of the pocket to `INSIDE` lengths within the
    contact. flow: eta U of the cold oil before the inlet.
    """
    found, law, ratio, rise = newtonian_inlet(), p.warm_viscosity, 1.0, 0.0
    for _ in range(20):
        length, unit = edge.length(ratio * flow), edge.thickness(ratio * flow)
        part = (found.X[1:] > -INSIDE) & (found.X[:-1] < max(edge.pocket / length, 5.0))
        X, P, H = (0.5 * (a[1:] + a[:-1])[part][::-1] for a in (found.X, found.P, found.H))
        slope = (np.diff(found.P) / np.diff(found.X))[part][::-1] * edge.rise**0.5 / length**0.5
        h = unit * H
        pressure = edge.rise**0.5 * length**0.5 * P
        eta = ratio * flow / speed * np.exp(p.pressure_viscosity * pressure)
        width = length * np.diff(found.X)[part][::-1]
        warm = warm_film(
            moving_half_space(-length * X, width, speed),
            width,
            h=h,
            heat=eta * speed**2 / h + h**3 * slope**2 / (12.0 * eta),
            flux=0.5 * speed * unit * found.H_star,
            height=p.depth,
        )
        h_star = unit * found.H_star
        rise = inlet_mean(h, h_star, warm.oil)
        wanted = float(np.exp(inlet_mean(h, h_star, np.log(law(warm.oil)))))
        if abs(wanted / ratio - 1.0) < 1e-5:
            break
        ratio = (ratio * wanted) ** 0.5
    return ratio, rise


def _thinning_oil(p: Seal) -> ThinningOil | None:
    """The oil of a case if it thins under shear."""
    values = p.thinning_values(p.viscosity)
    if not values:
        return None
    if p.thins == "eyring":
        return ThinningOil(values["critical_stress"])
    return ThinningOil(
        values["critical_stress"], values["thinning_exponent"], values["thinning_plateau"]
    )


@dataclass(frozen=True)
class _Surface:
    """The deformed arc of a dry contact.

    s: length along it (nodes,). points: (nodes, 2). p: excess pressure (nodes,). along: stretch
    (segments,). hoop: stretch (nodes,). z_range: least and largest z of the section.
    """

    s: Array
    points: Array
    p: Array
    along: Array
    hoop: Array
    z_range: tuple[float, float]

    @classmethod
    def of(cls, system: SealSystem, x: Array) -> _Surface:
        """The arc of the contact x (n,)."""
        arc, deformed = system.mesh.arc_nodes, system.deformed(x)
        free, points = system.mesh.points[arc], deformed[arc]
        undeformed, deformed_lengths = (
            np.linalg.norm(np.diff(at, axis=0), axis=1) for at in (free, points)
        )
        return cls(
            s=np.r_[0.0, np.cumsum(deformed_lengths)],
            points=points,
            p=excess_pressure(system, x),
            along=deformed_lengths / undeformed,
            hoop=np.abs(points[:, 1] / free[:, 1]),
            z_range=(float(deformed[:, 0].min()), float(deformed[:, 0].max())),
        )

    def drawn_in(
        self, p: Seal, nodes: Integers, speed: float, flow: float, last: Integers | None
    ) -> Prediction | None:
        """The film at the edge at which nodes (n,) begin, at |U|; flow: eta U, MPa mm.

        last: nodes of the contact before it, up to which its pocket reaches.
        """
        if len(nodes) <= FEWEST_NODES:
            return None
        edge, length = None, 0.0
        for _ in range(4):
            edge = self.edge(p, nodes, length, last)
            if edge is None:
                return None
            length = edge.length(flow)
        assert edge is not None
        inlet_rise = 0.0
        if p.heating:
            ratio, inlet_rise = warm_inlet(p, edge, flow=flow, speed=speed)
            flow *= ratio
        try:
            h_star = edge.h_star(flow, p.pressure_viscosity, _thinning_oil(p))
        except ArithmeticError:
            return None
        unsettled = 0.0
        if not p.round:
            count = 2 * self._fitted(nodes, length)
            wider = self._root(nodes, min(count, len(nodes) - 1))
            unsettled = abs(wider[1] / edge.rise - 1.0) if wider else inf
        return Prediction(h_star, length / edge.pocket, edge, length, unsettled, inlet_rise)

    def edge(self, p: Seal, nodes: Integers, length: float, last: Integers | None) -> Edge | None:
        """The edge at which nodes (n,) begin, for an inlet of this length; None without a root.

        last: see `drawn_in`.
        """
        found = self._root(nodes, self._fitted(nodes, length))
        if found is None:
            return None
        first, rise, bend = found
        inwards = 1.0 if nodes[-1] > nodes[0] else -1.0
        place = self.s[nodes[0]] + inwards * first
        z = float(np.interp(place, self.s, self.points[:, 0]))
        outwards = np.sign(self.points[nodes[0], 0] - self.points[nodes[-1], 0])
        end = self.z_range[1] if outwards > 0.0 else self.z_range[0]
        if last is not None:
            end = float(self.points[last[-1], 0])
        return Edge(
            rise=rise,
            curvature=0.5 * bend / rise,
            modulus=self._modulus(p, place, length),
            pocket=max(abs(end - z), 1e-12),
        )

    def _fitted(self, nodes: Integers, length: float) -> int:
        """Number of nodes of a fit, without the first, for an inlet of this length."""
        distance = np.abs(self.s[nodes] - self.s[nodes[0]])
        return max(FEWEST_NODES, int((distance[1:] <= REACH * length).sum()))

    def _root(self, nodes: Integers, count: int) -> tuple[float, float, float] | None:
        """Place, slope and second coefficient of p^2 at the edge; None without a root.

        p^2 is a parabola over the distance, fitted without the first node, whose pressure depends
        on where the edge lies between two nodes.
        """
        distance = np.abs(self.s[nodes] - self.s[nodes[0]])
        d, squares = distance[1 : count + 1], self.p[nodes[1 : count + 1]] ** 2
        fit = np.polyfit(d, squares, 2, w=1.0 / (squares + 0.02 * squares.max()))
        roots = np.roots(fit)
        real = roots[np.isreal(roots)].real
        if not len(real):
            return None
        first = float(real[np.argmin(np.abs(real))])
        rise = float(np.polyval(np.polyder(fit), first))
        return (first, rise, float(fit[0])) if rise > 0.0 else None

    def _modulus(self, p: Seal, s: float, length: float) -> float:
        """E* at a place of the arc, from the stretches within two lengths of an inlet."""
        middle = 0.5 * (self.s[1:] + self.s[:-1])
        mask = np.abs(middle - s) < max(2.0 * length, 0.01)
        if not mask.any():
            mask = np.arange(len(middle)) == int(np.argmin(np.abs(middle - s)))
        rubber = p.surface_rubber
        material, values = MATERIALS[rubber.material], dict(rubber.rubber_values)
        del values["kappa"]
        return incremental_modulus(
            lambda along, hoop: incremental_stiffness(material, values, along, hoop),
            float(self.along[mask].mean()),
            float(np.interp(s, self.s, self.hoop)),
        )
