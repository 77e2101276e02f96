"""From an optimised graph to C: outputs, schedule, order, and the text of each target."""
