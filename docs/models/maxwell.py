"""A bar that creeps: a spring beside a spring and dashpot in series, the dashpot's strain local."""

from softehl import Definition, Model, quadrature


def maxwell() -> Definition:
    """Stress E_0 e + s with s = E_1 (e - v) and Norton's law dv/dt = A s^3, backward Euler."""
    m = Model("maxwell", nodes=2, rule=quadrature.gauss(1, 1), unroll=True, doc=maxwell.__doc__)
    (X,) = m.coordinates("X")
    (u,) = m.nodal_unknowns("u")
    E_0, E_1, A, dt = m.parameters(
        E_0="modulus of the spring beside [MPa]",
        E_1="modulus of the spring in series [MPa]",
        A="Norton's coefficient [1/(MPa^3 s)]",
        dt="length of the time step [s]",
    )
    (v_old,) = m.point_data(v_old="viscous strain at the beginning of the step")
    length = m.define("length", X[1] - X[0])
    e = m.define("e", (u[1] - u[0]) / length)

    def flow(v):
        return v - v_old - dt * A * (E_1 * (e - v)) ** 3

    v = m.implicit("v", flow, start=v_old)
    s = m.define("s", E_1 * (e - v))
    m.weak_form([((E_0 * e + s) * length / 2, e)])
    m.fields(v=v, s=s)
    return m.finish()
