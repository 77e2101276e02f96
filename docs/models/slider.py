"""Reynolds' equation along a line: a film between an inclined pad and a plane that slides."""

from softehl import Definition, Model, element, kinematics, quadrature


def slider() -> Definition:
    """The flux U h / 2 - h^3 / (12 eta) dp/dx is the same at all places."""
    m = Model("slider", nodes=2, rule=quadrature.gauss(2, 1), unroll=False)
    X = m.coordinates("X")
    eta, U = m.parameters(eta="viscosity", U="speed of the plane")
    inlet, slope = m.parameters(inlet="thickness at x = 0", slope="dh/dx")
    (xi,) = m.point()
    p, p_xi = m.interpolated("p")
    line = element("line2")
    e = kinematics.isoparametric(m, X, line.gradient(xi))
    x = sum(N * place for N, place in zip(line.shape(xi), X[0], strict=True))
    h = m.define("h", inlet + slope * x)
    dp = m.define("dp", p_xi / e.detJ)
    m.potential(m.integral("Pi", (h**3 / (24 * eta) * dp**2 - U * h / 2 * dp) * e.detJ))
    m.fields(p=p, load=p * e.detJ * m.weight)
    return m.finish()
