"""What a model page is written in: the model, its symbols, kinematics, shapes and rules."""
