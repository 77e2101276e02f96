"""Results of a study: values at points, fields at nodes, modes, files."""
