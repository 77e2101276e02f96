"""Parameters, files, progress and processes of every case; it knows no physics."""
