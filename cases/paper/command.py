"""`softehl reproduce`: choose items, compute their runs, write pictures, tables and captions."""

from collections.abc import Sequence
from pathlib import Path

import click

from softehl.cases.harness.errors import BadInput
from softehl.cases.paper.catalogue import ITEMS
from softehl.cases.paper.compute import compute
from softehl.cases.paper.drawing import write_picture
from softehl.cases.paper.item import Item, Scope
from softehl.cases.paper.states import Store, merged
from softehl.runtime.io import write_csv, write_text
from softehl.runtime.suggestions import meant


def chosen(names: Sequence[str]) -> list[Item]:
    """The items of these names, all of them if there are none.  Raises BadInput."""
    for name in names:
        if name not in ITEMS:
            hint = meant(name, ITEMS)
            raise BadInput(f"no table or figure {name!r}{hint}; allowed: {', '.join(ITEMS)}")
    return [ITEMS[name] for name in dict.fromkeys(names or ITEMS)]


def reproduce_items(
    names: Sequence[str], scope: Scope, folder: Path, *, resume: bool, jobs: int
) -> int:
    """Compute and write the items; return the exit code.  Raises BadInput."""
    items = chosen(names)
    store = Store(folder / "runs")
    requests = merged(request for item in items for request in item.requests(scope))
    compute(requests, store, resume=resume, jobs=jobs)
    try:
        for item in items:
            write_item(item, store, scope, folder)
    except OSError as error:
        where = error.filename or str(folder)
        raise BadInput(f"cannot write {where!r}: {error.strerror or error}") from None
    click.echo(f"written to {folder}: {', '.join(item.name for item in items)}")
    return 0


def write_item(item: Item, store: Store, scope: Scope, folder: Path) -> None:
    """Write <stem>.csv for each table of an item, <name>.png and <name>.txt, the caption."""
    product = item.make(store, scope)
    folder.mkdir(parents=True, exist_ok=True)
    for stem, table in product.tables.items():
        write_csv(folder / f"{stem}.csv", table.header, table.rows)
    write_text(folder / f"{item.name}.txt", f"{item.title}. {product.caption}\n")
    write_picture(product, folder / f"{item.name}.png")
