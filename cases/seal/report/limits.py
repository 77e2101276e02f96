"""Limits of the model of a seal, in words for a reader of results."""

LEFT_OUT = (
    "Time: every speed is a steady state; no start, no stop, no dwell.",
    "Viscoelasticity and set: the rubber is hyperelastic, and as it was made.",
    "Heat: oil and rubber are at one temperature, which friction does not raise.",
    "Shear thinning, unless the case has keys for it: the oil is then Newtonian.",
    "Roughness of rod and seal, unless the case has keys for it: a film thinner than the surfaces "
    "are rough is not what the numbers say.",
    "Starvation: both ends of the film are flooded, unless the case says otherwise.",
    "Eccentricity and bending: everything is axisymmetric.",
    "Fillets of the groove: its corners are sharp.",
    "The extrusion gap, unless the case opens it: the wall of the air side reaches the rod.",
    "Friction of the seal on its housing, unless the case has a coefficient.",
    "Wear, swelling and ageing: dimensions and moduli are those given.",
)
"""A report ends with these."""
