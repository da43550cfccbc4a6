"""The words of the code and its documents are the field's: the glossary is true, and old words are gone."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from launch import ROOT

GLOSSARY = ROOT / "docs" / "glossary.md"
MEANINGS, _, NOT_USED = GLOSSARY.read_text().partition("## Words not used")
ROW = re.compile(r"^\| (?!-|term|word)(.+?) \| (.*?) \| (.*?) ?\|$", re.MULTILINE)
OLD = {
    word: "prose" in held  # else in names alone
    for words, _, held in ROW.findall(NOT_USED)
    for word in words.split(", ")
}
PROSE_FILES = ("*.md", ".ci/*", "docs/*.md", "docs/cases/*.md", "inputs/*.toml", "launch/**/*.*")
EXCEPT = {GLOSSARY, ROOT / "CHANGELOG.md"}


def names_in(text: str) -> set[str]:
    """The names that a Python text defines: functions, classes, parameters, variables, attributes."""
    found = set()
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.arg(arg=name):
                found.add(name)
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                found.add(name)
    return found


def words_of(name: str) -> set[str]:
    """The words that a name is made of."""
    return {word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)}


def prose_in(text: str, python: bool) -> str:
    """Docstrings and comments of a Python text; of any other text all but what stands in backticks."""
    if not python:
        return re.sub(r"```.*?```|`[^`]*`", "", text, flags=re.DOTALL)
    tree = ast.parse(text)
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docstrings = [ast.get_docstring(node) or "" for node in ast.walk(tree) if isinstance(node, kinds)]
    comments = re.findall(r"(?:^|\s\s)# (.*)$", text, re.MULTILINE)
    return re.sub(r"`[^`]*`", "", "\n".join([*docstrings, *comments]))


def old_words_in(text: str, python: bool) -> set[str]:
    """The old words that a text uses, in names or in prose."""
    names = set().union(*map(words_of, names_in(text))) if python else set()
    prose = set(re.findall(r"[a-z]+", prose_in(text, python).lower()))
    return {word for word, in_prose in OLD.items() if word in names or (in_prose and word in prose)}


def files() -> Iterator[Path]:
    """All files that the words are held in."""
    yield from sorted((ROOT / "distfsi").rglob("*.py"))
    yield from sorted({path for pattern in PROSE_FILES for path in ROOT.glob(pattern) if path.is_file()} - EXCEPT)


def test_no_file_uses_an_old_word():
    found = {str(path.relative_to(ROOT)): old_words_in(path.read_text(), path.suffix == ".py") for path in files()}
    assert {path: words for path, words in found.items() if words} == {}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def evict(x):\n    pass\n", {"evict"}),
        ('"""The company of a cell."""\n', {"company"}),
        ("x = 1  # in the ledger\n", {"ledger"}),
        ('x = "the ledger"  # `ledger`, placed\n', set()),
    ],
)
def test_old_words_are_found(text, words):
    assert old_words_in(text, python=True) == words


def test_names_are_made_of_words():
    assert words_of("findMASTERKey_of2") == {"find", "master", "key", "of"}


@pytest.mark.parametrize(("term", "meaning", "where"), ROW.findall(MEANINGS), ids=lambda text: text[:20])
def test_the_glossary_is_true(term, meaning, where):
    """Each place is there, and each term has a meaning."""
    assert meaning.endswith(".") or ";" in meaning
    for path in re.findall(r"`([^`]+)`", where):
        assert list((ROOT / "distfsi").glob(path.rstrip("/"))), path


def test_the_glossary_is_in_order():
    for section in MEANINGS.split("\n## ")[1:]:
        terms = [term.lower() for term, _, _ in ROW.findall(section)]
        assert terms == sorted(terms)
