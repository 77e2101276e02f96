"""Contact: search, mortar elements in 2-D and 3-D, rigid obstacles."""
