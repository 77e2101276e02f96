"""A rubber whose energy is a C function."""

import softehl

LAW = """
#include <math.h>
/* x = I1, J, mu, K */
int law(const double *x, double *y, double *dy, double *ddy)
{
    const double J = x[1], mu = x[2], K = x[3], a = x[0] - 3 - 2 * log(J), b = J - 1;
    y[0] = mu / 2 * a + K / 2 * b * b;
    if (dy) dy[0] = mu / 2, dy[1] = K * b - mu / J, dy[2] = a / 2, dy[3] = b * b / 2;
    if (ddy) {
        for (int k = 0; k < 16; ++k) ddy[k] = 0;
        ddy[2] = ddy[8] = 0.5;
        ddy[5] = K + mu / (J * J);
        ddy[6] = ddy[9] = -1 / J;
        ddy[7] = ddy[13] = b;
    }
    return 0;
}
"""


@softehl.material
def foreign(m):
    """Compressible neo-Hooke, in C."""
    mu, K = m.parameters(mu="shear modulus [MPa]", K="bulk modulus [MPa]")
    C = m.define("C", m.F.T * m.F)
    J = m.define("J", m.F.det())
    m.energy(m.external("law", [C.trace(), J, mu, K], source=LAW, derivatives=2))
