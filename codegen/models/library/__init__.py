"""Elements and laws by name, one model file each; `softehl.codegen.tools.library` lists them."""
