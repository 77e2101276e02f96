"""The pages as a whole: links that lead somewhere, public names that are described, the site."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

import softehl
from tests.docs.pages import Reader, blocks

ROOT = Path(__file__).parents[2]
FOLDERS = ("gallery", "validation")
PLACES = ("*.md", "docs/*.md", *(f"docs/{name}/*.md" for name in FOLDERS), "benchmarks/*.md")
PAGES = sorted(page for place in PLACES for page in ROOT.glob(place))

_FENCED = re.compile(r"^```.*?^```$|^ {4}.*?$|`[^`\n]*`", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\]\(([^)\s]+)\)|<img[^>]* src=\"([^\"]+)\"|<a[^>]* href=\"([^\"]+)\"")
_HEADING = re.compile(r"^#+ +(.*)$", re.MULTILINE)


def links(page: Path) -> Iterator[str]:
    """Targets of the links and pictures of a page, without those in code."""
    for found in _LINK.finditer(_FENCED.sub("", page.read_text(encoding="utf-8"))):
        yield next(target for target in found.groups() if target)


def anchors(page: Path) -> set[str]:
    """What a link to a heading of the page may be called."""
    words = [re.sub(r"[^\w\- ]", "", h.lower()) for h in _HEADING.findall(page.read_text())]
    return {word.strip().replace(" ", "-") for word in words}


def is_named(page: Path) -> str:
    return str(page.relative_to(ROOT))


def test_links_lead_somewhere() -> None:
    for page in PAGES:
        for target in links(page):
            path, _, anchor = target.partition("#")
            if "://" in target or target.startswith("mailto:"):
                continue
            place = (page.parent / path).resolve() if path else page
            assert place.exists(), f"{target} does not exist"
            assert place.is_relative_to(ROOT), f"{target} leads out of the repository"
            if anchor and place.suffix == ".md":
                assert anchor in anchors(place), f"{target}: no such heading"


def test_addresses_are_well_formed() -> None:
    """Whether they answer cannot be seen from here."""
    for page in PAGES:
        for target in links(page):
            if "://" in target:
                address = urlsplit(target)
                assert address.scheme == "https", target
                assert re.fullmatch(r"[a-z0-9-]+(\.[a-z0-9-]+)+", address.netloc), target


def test_links_are_found() -> None:
    """The two tests above see something."""
    found = {is_named(page): list(links(page)) for page in PAGES}
    assert "docs/tutorial.md" in found["README.md"]
    assert "https://distributed.dask.org" in found["docs/many-curves.md"]


def in_trees(page: Path) -> set[str]:
    """Pages of its folder that a page has in its tables of contents."""
    trees = "\n".join(re.findall(r"```\{toctree\}(.*?)```", page.read_text(), re.DOTALL))
    return set(re.findall(r"^([\w-]+)$", trees, re.MULTILINE))


def test_every_page_is_on_the_front_page() -> None:
    front = ROOT / "docs" / "index.md"
    pages = {page.stem for page in (ROOT / "docs").glob("*.md")} - {"index"}
    assert in_trees(front) == pages
    assert {f"{page}.md" for page in pages} <= set(links(front))


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_page_of_a_folder_is_on_its_front_page(folder: str) -> None:
    front = ROOT / "docs" / folder / "index.md"
    pages = {page.stem for page in front.parent.glob("*.md")} - {"index"}
    assert in_trees(front) == pages
    assert {f"{page}.md" for page in pages} <= set(links(front))
    assert f"\n{folder}/index\n" in (ROOT / "docs" / "index.md").read_text()


def test_pictures_are_small_and_described() -> None:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        shown = re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", text)
        shown += [
            (alt, name) for name, alt in re.findall(r'<img src="([^"]+)"[^>]* alt="([^"]*)"', text)
        ]
        assert text.count("<img ") + text.count("![") == len(shown)
        for alt, name in shown:
            assert alt, f"{name} has no words for who cannot see it"
            assert (page.parent / name).stat().st_size < 150_000, name


def test_the_readme_does_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    reader, found = Reader(ROOT / "docs" / "models"), blocks((ROOT / "README.md").read_text())
    assert [block.kind for block in found] == ["python", "text"]
    assert found[0].text.count("\n") <= 25
    for block in found:
        reader.read(block)
    assert (tmp_path / "beam.vtu").exists()


@pytest.mark.slow
def test_the_site_needs_nothing_from_elsewhere(tmp_path: Path) -> None:
    pytest.importorskip("sphinx", reason="the extra `docs` is not installed")
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "-b", "html", "-c", "docs"]
    subprocess.run([*command, ".", str(tmp_path)], cwd=ROOT, check=True, timeout=300)
    for page in tmp_path.rglob("*.html"):
        loaded = re.findall(r"<(?:script|img|link)[^>]*(?:src|href)=\"([^\"]+)\"", page.read_text())
        assert loaded
        assert [name for name in loaded if "//" in name] == []
    text = (tmp_path / "docs" / "api.html").read_text()
    found = set(re.findall(r'id="(?:module-)?softehl\.([\w.]+)"', text))
    assert set(softehl.__all__) <= {part for name in found for part in name.split(".")}
