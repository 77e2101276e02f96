"""Everything a user says of a seal: keys, catalogue, rubbers, oils, surfaces, sections."""
