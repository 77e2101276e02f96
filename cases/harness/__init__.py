"""What every case needs around it: parameters, files, progress, processes; no physics."""
