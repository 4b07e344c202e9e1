"""Pieces of an HTML page as text. What comes from users is escaped by the caller, or here where it says so."""

import base64
import json
from html import escape


def section(title, body, note="", ident=""):
    """A titled section; "" where the body is empty, so that a section without content leaves no trace."""
    if not body:
        return ""
    note = f'<p class="note">{note}</p>' if note else ""
    return f'<section id="{ident}"><h2>{title}</h2>{note}{body}</section>\n'


def table(columns, rows, is_sortable=False, foot=()):
    """A table; "" without rows.

    columns : tuples (head, kind, cell): kind "n" number or "t" text; cell(row) gives text already escaped, or
        (text, value to sort by)
    foot : cells of a last row, already escaped
    """
    if not rows:
        return ""
    css = {"n": ' class="num"', "t": ""}
    top = "".join(f"<th{css[kind]}>{head}</th>" for head, kind, _ in columns)
    lines = ["".join(_cell(css[kind], cell(row)) for _, kind, cell in columns) for row in rows]
    if foot:
        lines.append("".join(_cell(css[kind], value) for (_, kind, _), value in zip(columns, foot, strict=True)))
    sort = ' class="sortable"' if is_sortable else ""
    return (
        f'<div class="scroll"><table{sort}><thead><tr>{top}</tr></thead><tbody>'
        + "".join(f"<tr>{line}</tr>" for line in lines)
        + "</tbody></table></div>"
    )


def _cell(css, value):
    if isinstance(value, tuple):
        return f'<td{css} data-value="{escape(str(value[1]))}">{value[0]}</td>'
    return f"<td{css}>{value}</td>"


def bar(part, css="bar"):
    """A bar filled to a part in [0, 1]."""
    return f'<span class="{css}"><i style="width:{100 * min(1.0, max(0.0, part)):.1f}%"></i></span>'


def image(png, alt, css=""):
    """A picture of PNG bytes, inlined; "" without. alt is escaped."""
    return f'<img class="{css}" alt="{escape(alt)}" src="{data_uri(png)}">' if png else ""


def data_uri(png):
    """PNG bytes as a data URI."""
    return "data:image/png;base64," + base64.b64encode(png).decode()


def script_json(value):
    """JSON that may stand inside a script element: no `<` is left that could end it."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def script_file(path):
    """The text of a script file, which may stand inside a script element."""
    return path.read_text(encoding="utf-8").replace("</script", "<\\/script")
