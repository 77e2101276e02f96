"""softehl: soft elastohydrodynamic lubrication from SymPy models compiled to lean C.

The public names are listed here once and imported when they are first used, so that a script which
solves a case loads no SymPy and `softehl --help` loads nothing at all.
"""

import importlib
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import click

    from cases.observer import FilmState, Observer, Outcome, Silent
    from cases.oring import run as run_oring
    from cases.oring_parameters import ORing
    from runtime.continuation import Continuation
    from runtime.kernels import load_kernel
    from runtime.newton import Newton
    from runtime.solution import Branch, Solution, Status

__version__ = "0.1.0"

_PUBLIC = {
    "Branch": ("runtime.solution", "Branch"),
    "Continuation": ("runtime.continuation", "Continuation"),
    "FilmState": ("cases.observer", "FilmState"),
    "Newton": ("runtime.newton", "Newton"),
    "ORing": ("cases.oring_parameters", "ORing"),
    "Observer": ("cases.observer", "Observer"),
    "Outcome": ("cases.observer", "Outcome"),
    "Silent": ("cases.observer", "Silent"),
    "Solution": ("runtime.solution", "Solution"),
    "Status": ("runtime.solution", "Status"),
    "load_kernel": ("runtime.kernels", "load_kernel"),
    "run_oring": ("cases.oring", "run"),
}

__all__ = [
    "Branch",
    "Continuation",
    "FilmState",
    "Newton",
    "ORing",
    "Observer",
    "Outcome",
    "Silent",
    "Solution",
    "Status",
    "load_kernel",
    "main",
    "run_oring",
]


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    try:
        module, attribute = _PUBLIC[name]
    except KeyError:
        raise AttributeError(f"module 'softehl' has no attribute {name!r}") from None
    value = globals()[name] = getattr(importlib.import_module(module), attribute)
    return value


def __dir__() -> list[str]:
    return [*globals(), *_PUBLIC]


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; returns the exit code.  What is wrong is said in one line on stderr."""
    import click

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
    @click.option("--check", is_flag=True, help="Write nothing; exit 1 if generated/ is stale.")
    @click.option("--trace", metavar="KERNEL", help="Show what each pass did to a kernel.")
    @click.option(
        "--target",
        type=click.Choice(["simd", "scalar", "ufcx"]),
        default="simd",
        show_default=True,
        help="Four elements at once, one at a time, or cells for DOLFINx.",
    )
    @click.option("--out", type=click.Path(path_type=Path), help="Folder of another target.")
    def generate(
        models: tuple[Path, ...], check: bool, trace: str | None, target: str, out: Path | None
    ) -> int:
        """Regenerate the C files from the models (all of them if none is named)."""
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
