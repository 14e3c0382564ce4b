"""Parts of a report, which `html_report` renders."""
from typing import NamedTuple, Tuple


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


def numbered(blocks):
    """Number the captions of figures and tables."""
    counts = {Figure: 0, Table: 0}
    for block in blocks:
        if type(block) in counts:
            counts[type(block)] += 1
            block = block._replace(caption='%s %d: %s' % (type(block).__name__, counts[type(block)], block.caption))
        yield block
