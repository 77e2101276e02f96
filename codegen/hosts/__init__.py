"""Models for other programs: sources, a build file, a test and notes, one file a host."""
