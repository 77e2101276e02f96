"""The input of a user: keys, catalogue, rubbers, oils, surfaces, sections."""
