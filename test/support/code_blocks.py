"""Fenced blocks of code in Markdown pages."""
import os
import re
from collections import namedtuple

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PAGES = ['README.md'] + sorted('doc/' + name for name in os.listdir(os.path.join(ROOT, 'doc')) if name.endswith('.md'))

# Text between two fences; `language` is '' if the opening fence names none.
Block = namedtuple('Block', 'page line language text')


def blocks_in(page):
    with open(os.path.join(ROOT, page), encoding='utf-8') as stream:
        text = stream.read()
    return [Block(page, text.count('\n', 0, match.start()) + 1, match.group(1), match.group(2))
            for match in re.finditer(r'^```(\w*)\n(.*?)^```$', text, re.DOTALL | re.MULTILINE)]


BLOCKS = [block for page in PAGES for block in blocks_in(page)]


def claimed(beginning, language='bash'):
    """The only block that begins like this, for the test that runs it; a block on several pages counts once."""
    found = {block.text: block for block in BLOCKS if block.language == language and block.text.startswith(beginning)}
    if len(found) != 1:
        raise LookupError('%d blocks of %s begin with %r; 1 expected' % (len(found), language, beginning))
    return list(found.values())[0]
