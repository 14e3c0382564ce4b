"""Elements of an HTML page."""
import html

HEAD = '''<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>%s</title><style>
body { font: 16px/1.5 sans-serif; max-width: 54em; margin: 2em auto; padding: 0 1em; color: #222; }
table { border-collapse: collapse; margin: 1em 0; } td, th { padding: 0.15em 0.8em; text-align: right; }
th { border-bottom: 1px solid #888; } td:first-child, th:first-child { text-align: left; padding-left: 0; }
img { max-width: 100%%; } figure { margin: 1.5em 0; } figcaption { color: #555; font-size: 0.9em; }
</style></head><body>
'''


def page(title, pieces):
    """Complete page with the given elements."""
    return HEAD % html.escape(title) + '<h1>%s</h1>\n' % html.escape(title) + '\n'.join(pieces) + '\n</body></html>\n'


def heading(text):
    """Heading."""
    return '<h2>%s</h2>' % html.escape(text)


def paragraph(*sentences):
    """Paragraph of sentences without markup. Empty sentences are skipped."""
    return '<p>%s</p>' % html.escape(' '.join(sentence for sentence in sentences if sentence))


def table(header, rows):
    """Table of texts."""
    lines = [_row('th', header)] + [_row('td', row) for row in rows]
    return '<table>\n%s\n</table>' % '\n'.join(lines)


def figure(name, caption):
    """Image file in the folder of the page, with a caption."""
    caption = html.escape(caption)
    return '<figure><img src="%s" alt="%s"><figcaption>%s</figcaption></figure>' % (name, caption, caption)


def _row(cell, texts):
    return '<tr>%s</tr>' % ''.join('<%s>%s</%s>' % (cell, html.escape(text), cell) for text in texts)
