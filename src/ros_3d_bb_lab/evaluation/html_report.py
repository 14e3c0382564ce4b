"""Report as one HTML file that contains its figures."""
import base64
import html
import mimetypes
from typing import NamedTuple, Tuple

PAGE = '''<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>{title}</title><style>
body {{ font: 16px/1.5 sans-serif; max-width: 54em; margin: 2em auto; padding: 0 1em; color: #222; }}
table {{ display: block; overflow-x: auto; border-collapse: collapse; margin: 0.3em 0 1.2em; font-size: 0.9em; }}
td, th {{ padding: 0.15em 0.8em; text-align: right; vertical-align: top; }}
th {{ border-bottom: 1px solid #888; }} td:first-child, th:first-child {{ text-align: left; padding-left: 0; }}
.pairs td, .pairs th {{ text-align: left; }}
img {{ max-width: 100%; }} figure {{ margin: 1.5em 0; }}
@media (max-width: 600px) {{ td, th {{ padding: 0.15em 0.25em; font-size: 0.85em; }} }}
figcaption, .caption {{ color: #444; font-size: 0.9em; margin: 0.5em 0 0; }}
</style></head><body>
<h1>{title}</h1>
{body}
</body></html>
'''


class Heading(NamedTuple):
    text: str


class Paragraph(NamedTuple):
    text: str


class Table(NamedTuple):
    """Table of text. The caption is above it."""

    caption: str
    header: Tuple[str, ...]
    rows: Tuple[Tuple[str, ...], ...]


class Figure(NamedTuple):
    """PNG file in the folder of the report, and its caption."""

    name: str
    caption: str


def html_report(title, blocks, folder):
    """Render blocks as HTML text. Figures are read from a folder (pathlib.Path)."""
    return PAGE.format(title=html.escape(title), body='\n'.join(_rendered(block, folder) for block in blocks))


def _rendered(block, folder):
    if isinstance(block, Heading):
        return '<h2>%s</h2>' % html.escape(block.text)
    if isinstance(block, Paragraph):
        return '<p>%s</p>' % html.escape(block.text)
    caption = html.escape(block.caption)
    if isinstance(block, Figure):
        data = base64.b64encode((folder / block.name).read_bytes()).decode()
        return '<figure><img src="data:%s;base64,%s" alt="%s"><figcaption>%s</figcaption></figure>' % (
            mimetypes.guess_type(block.name)[0], data, caption, caption)
    rows = [_row('th', block.header)] + [_row('td', row) for row in block.rows]
    kind = ' class="pairs"' if len(block.header) == 2 else ''  # names and values, which may be text
    return '<p class="caption">%s</p>\n<table%s>\n%s\n</table>' % (caption, kind, '\n'.join(rows))


def _row(cell, texts):
    return '<tr>%s</tr>' % ''.join('<%s>%s</%s>' % (cell, html.escape(text), cell) for text in texts)


def numbered(blocks):
    """Number the captions of figures and tables."""
    counts = {Figure: 0, Table: 0}
    for block in blocks:
        if type(block) in counts:
            counts[type(block)] += 1
            block = block._replace(caption='%s %d: %s' % (type(block).__name__, counts[type(block)], block.caption))
        yield block
