"""The command line, `softehl` or `python -m softehl`; what is heavy is imported late."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from softehl import SymPyNeededError, __version__, with_sympy
from softehl.cases.harness.signals import Ended, readers_that_leave, signals

if TYPE_CHECKING:
    import click


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Words after the program's name; those of the process if left out.

    Returns
    -------
    int
        Exit code. An error is one line on stderr.
    """
    import click

    # One thread a process, before NumPy is loaded: the systems are small, the runs are parallel.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ["MPLBACKEND"] = "agg"  # pictures go to files, whatever a user shows elsewhere
    with signals(), readers_that_leave():
        try:
            code = _commands().main(
                None if arguments is None else list(arguments),
                prog_name="softehl",
                standalone_mode=False,
            )
        except click.ClickException as error:
            hint, words = _hint(error), error.format_message()
            words = f"{words.removesuffix('.')}; {hint}" if hint else words
            click.echo(f"softehl: {' '.join(words.split())}", err=True)
            return error.exit_code
        except SymPyNeededError as error:
            click.echo(f"softehl: {error}", err=True)
            return 2
        except (click.Abort, KeyboardInterrupt):
            click.echo("softehl: interrupted; what was reached is saved", err=True)
            return 130
        except Ended as end:
            click.echo(f"softehl: ended by {end}; what was reached is saved", err=True)
            return 128 + end.number
        return code if isinstance(code, int) else 0


def _hint(error: "click.ClickException") -> str:
    """Say what is allowed, or how a key is set, for a word on the command line."""
    import click

    if not isinstance(error, click.UsageError) or error.ctx is None:
        return ""
    command = error.ctx.command
    if "assignments" not in [option.name for option in command.params] or isinstance(
        error, click.BadParameter
    ):
        return _allowed(error, error.ctx, command)
    how = "a key of the case is set by --set KEY=VALUE"
    if isinstance(error, click.NoSuchOption):
        key = error.option_name.lstrip("-")
        return "" if error.possibilities else f"{how}, as in --set {key}=..."
    return how if "unexpected extra argument" in error.format_message() else ""


def _allowed(error: "click.UsageError", context: "click.Context", command: "click.Command") -> str:
    """Say what is allowed in place of a command, an argument or a whole number."""
    import click

    from softehl.cases.shipped import SHIPPED

    if isinstance(command, click.Group):
        no_command = "command" in error.format_message().lower()
        return f"allowed: {', '.join(command.list_commands(context))}" if no_command else ""
    arguments = [p.make_metavar(context) for p in command.params if isinstance(p, click.Argument)]
    if isinstance(error, click.MissingParameter):
        missed = error.param is not None and error.param.name == "case"
        return f"allowed: {', '.join(SHIPPED)} or a TOML file" if missed else ""
    if isinstance(error, click.BadParameter):
        kind = error.param.type if error.param is not None else None
        whole = isinstance(kind, click.IntRange) and "is not a valid" in error.format_message()
        return "allowed: a whole number from 1" if whole else ""
    extra = "unexpected extra argument" in error.format_message()
    return f"allowed: {context.command_path} {' '.join(arguments)}".rstrip() if extra else ""


def _commands() -> "click.Group":
    import click

    from softehl.cases.cli import app, design, keys, report_runs, reproduce, run, sweep
    from softehl.codegen.hosts.registry import targets

    @click.group(no_args_is_help=False)
    @click.version_option(__version__, prog_name="softehl")
    def commands() -> None:
        """Soft elastohydrodynamic lubrication: generate kernels, run cases."""

    @commands.command()
    @click.argument("models", metavar="[MODEL.py]...", nargs=-1, type=click.Path(path_type=Path))
    @click.option("--check", is_flag=True, help="Write nothing; exit 1 if a file is out of date.")
    @click.option("--trace", metavar="KERNEL", help="Show KERNEL before and after each pass.")
    @click.option(
        "--target",
        type=click.Choice(list(dict.fromkeys(["simd", "scalar", "ufcx", *targets()]))),
        default="simd",
        show_default=True,
        help="C for several elements at once (simd) or one (scalar), or code for another program.",
    )
    @click.option(
        "--out",
        metavar="DIR",
        type=click.Path(path_type=Path, file_okay=False),
        help="Folder for MODEL.py or --target  [default: generated/MODEL beside MODEL.py]",
    )
    @click.option(
        "--check-seconds",
        type=click.FloatRange(min=0, min_open=True),
        default=10.0,
        show_default=True,
        help="Time limit for the check of each kernel against its page.",
    )
    @click.option(
        "--cell", "cells", multiple=True, help="Cell for pages of fields, e.g. hex8. Repeatable."
    )
    @click.option(
        "--geometry",
        type=click.Choice(["plane strain", "axisymmetric", "solid"]),
        help="Geometry for pages of fields in two dimensions  [default: plane strain]",
    )
    def generate(
        models: tuple[Path, ...],
        check: bool,
        trace: str | None,
        target: str,
        out: Path | None,
        check_seconds: float,
        cells: tuple[str, ...],
        geometry: str | None,
    ) -> int:
        """Derive, compile and check the kernels of the models in MODEL.py.

        The file is run; a model is a function under `@softehl.page`, for each --cell, or one
        without arguments annotated `-> Definition`.
        Without a file the kernels that ship, in generated/, are regenerated.
        """
        with with_sympy():
            from softehl.codegen.language.weak_form import CellOptions
            from softehl.codegen.tools.cli import generate

            return generate(
                models,
                check=check,
                trace=trace,
                target=target,
                out=out,
                seconds=check_seconds,
                on=CellOptions(cells, geometry),
            )

    @commands.command()
    @click.option("--show", metavar="NAME", help="Print the model file of an element or law.")
    def elements(show: str | None) -> int:
        """List the library: elements and laws with parameters, source and benchmark."""
        from softehl.cases.harness.errors import BadInput
        from softehl.codegen.tools.library import LibraryError, print_list, text_of

        try:
            click.echo(text_of(show), nl=False) if show else print_list()
        except LibraryError as error:
            raise BadInput(str(error)) from None
        return 0

    @commands.command()
    def kernels() -> int:
        """Show what the kernels cost, and which library and C compiler are used."""
        from softehl.cases.harness.errors import BadInput
        from softehl.codegen.abi import BuildError
        from softehl.codegen.tools.build import compiler_name
        from softehl.codegen.tools.cost_table import kernels
        from softehl.runtime.kernels.shared_library import KernelError, library_of

        try:
            library = library_of()
        except KernelError as error:
            raise BadInput(str(error)) from None
        code = kernels()
        why = f" ({library.reason})" if library.reason else ""
        click.echo(f"{library.kind} library{why}: {library.path}")
        try:
            click.echo(f"compiler {compiler_name()}")
        except BuildError as error:
            click.echo(f"no compiler: {error}")
        return code

    commands.add_command(design)
    commands.add_command(run)
    commands.add_command(sweep)
    commands.add_command(keys)
    commands.add_command(report_runs)
    commands.add_command(app)
    commands.add_command(reproduce)
    return commands


if __name__ == "__main__":
    sys.exit(main())
