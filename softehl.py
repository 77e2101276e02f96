"""softehl: soft elastohydrodynamic lubrication from SymPy models compiled to lean C.

The public names are listed here once and imported when they are first used, so that a script which
solves a case loads no SymPy and `softehl --help` loads nothing at all.
"""

import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import click

    from cases.observer import FilmState, Observer, Outcome, Silent
    from cases.oring import run as run_oring
    from cases.oring_parameters import ORing
    from cases.sweep import Curve, solve_cases
    from codegen import kinematics, quadrature, shapes
    from codegen.model import Definition, Model
    from runtime.assembly import Assembler, ElementBlock
    from runtime.continuation import Continuation
    from runtime.dofs import DofLayout
    from runtime.kernels import Kernel
    from runtime.newton import Newton
    from runtime.problem import Problem
    from runtime.solution import Branch, Solution, Status

__version__ = "0.1.0"

_PUBLIC = {
    "Assembler": "runtime.assembly",
    "Branch": "runtime.solution",
    "Continuation": "runtime.continuation",
    "Curve": "cases.sweep",
    "DofLayout": "runtime.dofs",
    "ElementBlock": "runtime.assembly",
    "FilmState": "cases.observer",
    "Kernel": "runtime.kernels",
    "Newton": "runtime.newton",
    "ORing": "cases.oring_parameters",
    "Observer": "cases.observer",
    "Outcome": "cases.observer",
    "Problem": "runtime.problem",
    "Silent": "cases.observer",
    "Solution": "runtime.solution",
    "Status": "runtime.solution",
    "run_oring": "cases.oring:run",
    "solve_cases": "cases.sweep",
}
_MODELLING = {
    "Definition": "codegen.model",
    "Model": "codegen.model",
    "kinematics": "codegen",
    "quadrature": "codegen",
    "shapes": "codegen",
}
"""What a model page needs; these import SymPy."""

__all__ = [
    "Assembler",
    "Branch",
    "Continuation",
    "Curve",
    "Definition",
    "DofLayout",
    "ElementBlock",
    "FilmState",
    "Kernel",
    "Model",
    "Newton",
    "ORing",
    "Observer",
    "Outcome",
    "Problem",
    "Silent",
    "Solution",
    "Status",
    "kinematics",
    "load_kernel",
    "main",
    "quadrature",
    "run_oring",
    "shapes",
    "solve_cases",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    place = _PUBLIC.get(name) or _MODELLING.get(name)
    if place is None:
        raise AttributeError(f"module 'softehl' has no attribute {name!r}")
    module, _, attribute = place.partition(":")
    imported = importlib.import_module(f"{module}.{name}" if module == "codegen" else module)
    value = imported if module == "codegen" else getattr(imported, attribute or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*globals(), *_PUBLIC, *_MODELLING]


def load_kernel(source: "str | Path | Definition", name: str | None = None) -> "Kernel":
    """A compiled kernel, by any of

    - the name of one that ships: `load_kernel("solid_q4")`;
    - a model file: `load_kernel("my_model.py")`, with `name` where it has several models.  It is
      derived and compiled if the cache does not have it; the file is run then;
    - a folder that `softehl generate` wrote: `load_kernel("generated/my_model")`;
    - a `Definition`, for notebooks.

    Raises `runtime.kernels.KernelError`, or what is wrong with the model or the compiler.
    """
    from runtime import kernels

    if isinstance(source, str) and not source.endswith(".py") and not Path(source).is_dir():
        return kernels.load_kernel(source)
    if isinstance(source, (str, Path)) and Path(source).is_dir():
        return kernels.kernel_in(Path(source).resolve(), name)
    from codegen import library

    place = Path(source) if isinstance(source, str) else source
    return kernels.kernel_in(library.folder_of(place), name)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code.  What is wrong is said in one line on stderr."""
    import click

    # One thread a process, before NumPy is loaded: the systems are small, the runs are parallel.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        code = _commands().main(
            None if arguments is None else list(arguments),
            prog_name="softehl",
            standalone_mode=False,
        )
    except click.ClickException as error:
        click.echo(f"softehl: {' '.join(error.format_message().split())}", err=True)
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo("softehl: interrupted; what was reached is saved", err=True)
        return 130
    return code if isinstance(code, int) else 0


def _commands() -> "click.Group":
    import click

    from cases.cli import reproduce, run

    @click.group(no_args_is_help=False)
    @click.version_option(__version__, prog_name="softehl")
    def commands() -> None:
        """Soft elastohydrodynamic lubrication: generate kernels, run cases."""

    @commands.command()
    @click.argument("models", metavar="[MODEL.py]...", nargs=-1, type=click.Path(path_type=Path))
    @click.option("--check", is_flag=True, help="Write nothing; exit 1 if anything is stale.")
    @click.option("--trace", metavar="KERNEL", help="Show what each pass did to a kernel.")
    @click.option(
        "--target",
        type=click.Choice(["simd", "scalar", "ufcx"]),
        default="simd",
        show_default=True,
        help="Four elements at once, one at a time, or cells for DOLFINx.",
    )
    @click.option(
        "--out",
        metavar="DIR",
        type=click.Path(path_type=Path, file_okay=False),
        help="Folder for MODEL.py or --target  [default: generated/MODEL beside MODEL.py]",
    )
    def generate(
        models: tuple[Path, ...], check: bool, trace: str | None, target: str, out: Path | None
    ) -> int:
        """Derive, compile and check the kernels of your own models, in MODEL.py.

        The file is run; a model is a function without arguments annotated `-> Definition`.
        Without a file the kernels that ship, in generated/, are regenerated.
        """
        from codegen.cli import generate

        return generate(models, check, trace, target, out)

    @commands.command()
    def kernels() -> int:
        """Show what the kernels cost: the table of manifest.json."""
        from codegen.cli import kernels

        return kernels()

    commands.add_command(run)
    commands.add_command(reproduce)
    return commands


if __name__ == "__main__":
    sys.exit(main())
