"""Heat conduction with capacity and a source.

Cells: any
Source: Carslaw and Jaeger (1959), Conduction of Heat in Solids.
Benchmark: bar with a step of temperature at one end, temperature at its middle.
"""

from softehl import Fields, page


@page
def heat(m: Fields) -> None:
    """capacity dT/dt = div(conductivity grad T) + supply."""
    T = m.scalar("T")
    k, c, r = m.parameters(
        conductivity="conductivity [W/(mm K)]",
        capacity="capacity of a volume [J/(mm3 K)]",
        supply="heat of a volume [W/mm3]",
    )
    m.require(k > 0, c >= 0)
    m.weak(k * m.grad(T), m.grad(T))
    m.weak(c * m.rate(T) - r, T)
    m.fields(q_x=-k * m.grad(T)[0])
