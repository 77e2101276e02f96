"""Model pages of the kind that users write: what the tests of the language read."""
