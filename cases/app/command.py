"""`softehl app`; Panel is imported when the command runs."""

from pathlib import Path

import click

_MISSING = "softehl app needs Panel: pip install 'softehl[app]'"


@click.command()
@click.option(
    "--folder",
    metavar="DIR",
    default="results",
    show_default=True,
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of the runs; the app also shows runs that it already has.",
)
@click.option(
    "--port",
    metavar="N",
    default=0,
    type=click.IntRange(0, 65535),
    help="Port of the address  [default: a free one]",
)
@click.option("--no-browser", is_flag=True, help="Print the address, open no browser.")
def app(folder: Path, port: int, no_browser: bool) -> int:
    """Choose a seal, run it and compare runs, in a browser on this machine.

    Prints the address with its token; the server refuses requests without it. Ctrl-C ends the
    app and the runs that it started; their computed states are saved.
    """
    from softehl.cases.harness.errors import BadInput

    try:
        from softehl.cases.app.server import serve
    except ImportError as error:
        raise BadInput(f"{_MISSING} ({error})") from None
    serve(folder, port, show=not no_browser)
    return 0
