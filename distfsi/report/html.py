"""HTML of a report: one file that needs no network, readable on a phone and on a wide screen."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape

STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 0 1rem 3rem; max-width: 70rem; color: #1c2733; background: #fff;
  font: 1rem/1.5 system-ui, "Segoe UI", "Noto Sans", "DejaVu Sans", sans-serif; }
header { border-bottom: 2px solid #1f4e79; padding: 1.5rem 0 .8rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.25rem; margin: 2.2rem 0 .6rem; color: #1f4e79; }
p { margin: .4rem 0; max-width: 46rem; }
nav ul { display: flex; flex-wrap: wrap; gap: .2rem 1.1rem; list-style: none; margin: .8rem 0 0; padding: 0; }
a { color: #14558f; }
figure { margin: 1rem 0; overflow-x: auto; }
img { max-width: 100%; min-width: 36rem; height: auto; border: 1px solid #d8dee5; }
figcaption, .note { color: #4a5867; font-size: .9rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .3rem .8rem .3rem 0; border-bottom: 1px solid #d8dee5; vertical-align: top; }
th:first-child, td:first-child, td.words, th.words { text-align: left; }
td { white-space: nowrap; }
td.words { min-width: 8rem; white-space: normal; }
.warning { border-left: 4px solid #b3541e; padding: .1rem 0 .1rem .8rem; }
pre { background: #f3f5f8; padding: .8rem; overflow-x: auto; font-size: .85rem; }
"""


def page(title: str, lines: Sequence[str], sections: Sequence[tuple[str, str]]) -> str:
    """A whole page: what stands below its title, and sections by their heading."""
    links = "".join(f'<li><a href="#{anchor(name)}">{escape(name)}</a></li>' for name, _ in sections)
    body = "".join(
        f'<section aria-labelledby="{anchor(name)}"><h2 id="{anchor(name)}">{escape(name)}</h2>{text}</section>\n'
        for name, text in sections
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta name="generator" content="{GENERATOR}">\n<title>{escape(title)}</title>\n'
        f'<link rel="icon" href="data:,">\n<style>{STYLE}</style>\n</head>\n<body>\n<header><h1>{escape(title)}</h1>'
        f'{"".join(map(paragraph, lines))}<nav aria-label="Sections"><ul>{links}</ul></nav></header>\n'
        f"<main>\n{body}</main>\n</body>\n</html>\n"
    )


GENERATOR = "distfsi report"


def anchor(name: str) -> str:
    """The name of a heading in links."""
    return name.lower().replace(" ", "-")


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of a `kind`: "", "note" or "warning"."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], words: Sequence[int] = ()) -> str:
    """A table whose columns of these numbers hold `words`, and all but the first of the others figures."""

    def cell(tag: str, n: int, text: str) -> str:
        scope = ' scope="col"' if tag == "th" else ""
        return f"<{tag}{scope}{' class=words' if n in words else ''}>{escape(text)}</{tag}>"

    head = "".join(cell("th", n, text) for n, text in enumerate(heads))
    body = "".join(f"<tr>{''.join(cell('td', n, text) for n, text in enumerate(row))}</tr>" for row in rows)
    return (
        f'<div class="wide" tabindex="0" role="region" aria-label="Table: {escape(heads[0])}"><table><thead><tr>{head}'
        f"</tr></thead><tbody>{body}</tbody></table></div>\n"
    )


def figure(png: bytes, text: str) -> str:
    """A picture within the page, with `text` below it and for those who do not see it."""
    data = base64.b64encode(png).decode()
    return (
        f'<figure tabindex="0"><img src="data:image/png;base64,{data}" alt="{escape(text, quote=True)}">'
        f"<figcaption>{escape(text)}</figcaption></figure>\n"
    )


def folded(summary: str, text: str) -> str:
    """A text as it is, to be unfolded."""
    return f"<details><summary>{escape(summary)}</summary><pre>{escape(text)}</pre></details>\n"
