"""The language of model pages: the model, its symbols, kinematics, shapes and rules."""
