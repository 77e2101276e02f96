"""Independent 50-digit references of the element residuals, tangents and fields.

Written from the equations of the paper (1)-(28) alone: no code is shared with the generator, and
every derivative is a central difference in 110 digits.
"""
