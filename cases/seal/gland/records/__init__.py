"""Records of a seal: groups of keys, with the values that follow from them alone."""
