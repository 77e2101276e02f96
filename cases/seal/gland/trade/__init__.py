"""Trade names of rings, fits, oils, rubbers and finishes, read from texts.

Each file reads one kind of name. A name that it does not understand is an error with the nearest
known forms.
"""
