"""The language of the trade: names of rings, fits, oils, rubbers and finishes, read from texts.

Each file reads one kind of name, and answers what it does not understand with the nearest forms
that it does.
"""
