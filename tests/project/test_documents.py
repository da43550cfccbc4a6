"""Commands, links and keys that the documents show are those that there are."""

import json
import re
import shlex
from pathlib import Path

import pytest

from distfsi.commands.line import COMMANDS, parser, with_command
from distfsi.errors import InputError
from distfsi.scene import load
from distfsi.scene.reference import json_schema
from launch import ROOT

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "launch" / "README.md"])
LINKED_FROM = ROOT / "README.md"
START = re.compile(r"^(\$ )?(mpiexec -n \w+ |srun )?(python -m )?distfsi(?= )")
CODE = re.compile(r"^```(?:bash|console|text)?\n(.*?)^```|`([^`\n]+)`", re.MULTILINE | re.DOTALL)
PLACEHOLDER = re.compile(r"\b[A-Z]{2,}\b|\.\.\.|\[NAME\]|^N$")
LINK = re.compile(r"\]\((?!https?:)([^)\s]+)\)")


def commands_in(text):
    """The words behind `distfsi` of each command that a page shows, in blocks and in backticks."""
    for block, inline in CODE.findall(text):
        for line in (block or inline).replace("\\\n", " ").splitlines():
            if START.match(line):
                try:
                    yield shlex.split(START.sub("", line.split(" && ")[0]), comments=True)
                except ValueError:  # a quotation over several lines of prose
                    continue


COMMANDS_SHOWN = [
    pytest.param(words, id=f"{path.relative_to(ROOT)}: {' '.join(words)}")
    for path in PAGES
    if path.name != "CHANGELOG.md"
    for words in commands_in(path.read_text())
    if words
]


def options():
    """By command the words that begin with a dash and that it takes."""
    (commands,) = (action for action in parser()._actions if action.choices)
    return {name: set(one._option_string_actions) for name, one in commands.choices.items()}


def test_commands_are_found():
    text = "`distfsi plot out/x`, `python -m distfsi a.toml`\n```bash\nmpiexec -n 2 distfsi run b.toml # why\n```\n"
    assert list(commands_in(text)) == [["plot", "out/x"], ["a.toml"], ["run", "b.toml"]]
    assert len(COMMANDS_SHOWN) > 80


@pytest.mark.parametrize("words", COMMANDS_SHOWN)
def test_a_command_in_the_documents_is_one(words):
    """Its flags exist; where nothing is a placeholder it parses, and a shipped scene is valid with its settings."""
    if words[0] in ("COMMAND", "--help", "--version") or "--help" in words:
        return
    name, *rest = with_command(words)
    assert name in COMMANDS
    flags = {word.partition("=")[0] for word in rest if re.match(r"--?[a-z]", word)}
    assert flags <= options()[name]
    if any(PLACEHOLDER.search(word) for word in rest) or (len(words) == 1 and name in COMMANDS):
        return
    given = parser().parse_args([name, *(rest[: rest.index(">")] if ">" in rest else rest)])
    if name in ("run", "check"):
        scene = ROOT / "inputs" / Path(given.input).name
        if scene.exists():
            load(scene, given.set)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_to_headings_that_are_there(page):
    for target in LINK.findall(page.read_text()):
        file, _, anchor = target.partition("#")
        path = (page.parent / file).resolve() if file else page
        assert path.exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.+)$", path.read_text(), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w\- ]", "", each.lower()).replace(" ", "-") for each in headings}, target


@pytest.mark.parametrize("wrong", ["plot out/x --flim", "plto out/x --movie", "sod.toml --set domain.cell=3"])
def test_a_stale_command_is_found(wrong):
    with pytest.raises((AssertionError, InputError)):
        test_a_command_in_the_documents_is_one(wrong.split())


def test_every_page_is_reached_from_the_readme():
    reached, new = set(), {LINKED_FROM}
    while new:
        reached |= new
        targets = {
            (page.parent / target.partition("#")[0]).resolve()
            for page in new
            if page.suffix == ".md"
            for target in LINK.findall(page.read_text())
        }
        pages = {path / "README.md" if path.is_dir() and (path / "README.md").exists() else path for path in targets}
        new = pages - reached
    assert {str(page.relative_to(ROOT)) for page in PAGES if page not in reached} == set()


def test_the_schema_for_editors_is_up_to_date():
    """`distfsi schema > docs/distfsi.schema.json`"""
    assert (ROOT / "docs" / "distfsi.schema.json").read_text() == json_schema()


def test_every_key_of_the_schema_says_what_it_is():
    schema = json.loads(json_schema())
    tables = {"Input": schema, **schema["$defs"]}
    keys = {
        f"{name}.{key}": node for name, table in tables.items() for key, node in table.get("properties", {}).items()
    }
    assert len(keys) > 200
    assert [key for key, node in keys.items() if not str(node.get("description", "")).strip()] == []
