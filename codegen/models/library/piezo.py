"""Linear piezoelectricity of a ceramic that is poled along z.

Cells: hex8, hex27, tet4, tet10
Source: Allik and Hughes (1970), IJNME 2, 151-157; IEEE Standard on Piezoelectricity 176 (1987).
Benchmark: free block under a voltage along z, strains d33 and d31 times the field.
"""

from softehl import Fields, page


@page
def piezo(m: Fields) -> None:
    """Enthalpy strain C strain / 2 - strain e E - E k E / 2 of the field E = -grad phi."""
    u, phi = m.vector("u"), m.scalar("phi")
    if len(u) != 3:
        raise ValueError("piezo needs a mesh in three dimensions, its poling is along z")
    C11, C12, C13, C33, C44 = m.parameters(
        C11="stiffness in the plane x-y [MPa]",
        C12="stiffness [MPa]",
        C13="stiffness [MPa]",
        C33="stiffness along z [MPa]",
        C44="shear stiffness with z [MPa]",
    )
    e31, e33, e15, k11, k33 = m.parameters(
        e31="stress along x by the field along z [N/(V mm)]",
        e33="stress along z by the field along z [N/(V mm)]",
        e15="shear stress by the field along x [N/(V mm)]",
        k11="permittivity at constant strain along x [N/V2]",
        k33="permittivity at constant strain along z [N/V2]",
    )
    m.require(C11 > 0, C33 > 0, C44 > 0, k11 > 0, k33 > 0)
    L, E = m.grad(u), -m.grad(phi)
    xx, yy, zz = (L[k, k] for k in range(3))
    xy, yz, xz = L[0, 1] + L[1, 0], L[1, 2] + L[2, 1], L[0, 2] + L[2, 0]
    plane = C11 * (xx**2 + yy**2) / 2 + C12 * xx * yy + (C11 - C12) / 4 * xy**2
    across = C13 * (xx + yy) * zz + C33 / 2 * zz**2 + C44 / 2 * (yz**2 + xz**2)
    mixed = e31 * (xx + yy) * E[2] + e33 * zz * E[2] + e15 * (xz * E[0] + yz * E[1])
    field = k11 / 2 * (E[0] ** 2 + E[1] ** 2) + k33 / 2 * E[2] ** 2
    m.minimise(plane + across - mixed - field)
    m.fields(
        sigma_zz=C13 * (xx + yy) + C33 * zz - e33 * E[2],
        D_z=e31 * (xx + yy) + e33 * zz + k33 * E[2],
    )
