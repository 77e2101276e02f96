"""The oil: its viscosity, how pressure and shear change it."""

from softehl.cases.harness.parameters import key
from softehl.cases.seal.gland.shear_thinning import ThinningKeys

THICKEST = 1e-3
"""Largest viscosity, MPa s."""


class Oil(ThinningKeys):
    """The oil at the temperature of the seal."""

    oil: str | None = key(
        None,
        "an oil by its grade or two viscosities, for viscosity and pressure_viscosity",
        bounds='"ISO VG 46", "HLP 46", "HVLP 46", "46 cSt at 40 degC, 6.8 cSt at 100 degC"',
    )
    temperature: float | None = key(
        None, "temperature of oil and rubber, where they depend on it", unit="degC", ge=-60, le=200
    )
    viscosity: float = key(
        6.59e-8,
        "dynamic viscosity eta_0 at zero pressure",
        unit="MPa s",
        bounds='1e-12 to 1e-3; 1e-9 MPa s is 1 mPa s, and "46 mPa s" may be written too',
        ge=1e-12,
        le=THICKEST,
    )
    pressure_viscosity: float = key(
        0.02, "coefficient alpha of eta = eta_0 exp(alpha p)", unit="1/MPa", ge=0, le=1
    )
    roelands: float | None = key(
        None,
        "Roelands' pressure-viscosity index z, for pressure_viscosity",
        bounds="0 to 2",
        ge=0,
        le=2,
    )
    oil_density: float | None = key(
        None,
        "density of the oil at 15 degC",
        unit="kg/m3",
        bounds="500 to 2000, left out = 870",
        ge=500,
        le=2000,
    )
