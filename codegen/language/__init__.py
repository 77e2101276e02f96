"""The language of models: the model, its symbols, kinematics, shapes and rules."""
